"""Which test made a run, and what the columns that every run has stand for in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

BIAXIAL, PUNCH = "biaxial", "punch"


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """What `axial_strain` and `stress_ratio` are called in a test: in a sentence, and on an axis.

    Attributes:
        strain, ratio: in a sentence.
        ratio_axis: on an axis, with its symbol.
        other: what the second curve of a run shows.
    """

    strain: str
    ratio: str
    ratio_axis: str
    other: str


WORDS: Mapping[str, Words] = {
    BIAXIAL: Words(
        strain="axial strain",
        ratio="stress ratio",
        ratio_axis=r"stress ratio $(\sigma_1-\sigma_2)/(\sigma_1+\sigma_2)$",
        other="volume change, dilation positive",
    ),
    PUNCH: Words(
        strain="settlement/punch width",
        ratio="punch pressure/confining stress",
        ratio_axis=r"punch pressure/confining stress $q/p$",
        other="solid fraction of the bed",
    ),
}


def test_of(manifest: Mapping[str, Any] | None) -> str:
    """Name the test of a run; what is no test of ours, or does not say, is read as a biaxial one.

    >>> test_of({"script": "punch.py"}), test_of(None)
    ('punch', 'biaxial')
    """
    name = PurePath(str((manifest or {}).get("script", ""))).stem
    return name if name in WORDS else BIAXIAL
