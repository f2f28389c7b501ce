"""The id of a run: the parameters that vary, readable, its seed, and a fingerprint of all parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from yade_scripts import parameters

SHORT_NAMES = {
    "rolling_friction": "mu_r",
    "friction": "mu",
    "particle_count": "n",
    "confining_stress": "p",
    "normal_stiffness": "kn",
    "tangential_stiffness_ratio": "kt",
    "rolling_stiffness_ratio": "kr",
    "inertial_number": "I",
    "size_distribution": "",
}


def run_id(varied: Mapping[str, Any], seed: Any, identity: Mapping[str, Any]) -> str:
    """Return the id of the run with all the parameters `identity`, of which `varied` differ from run to run.

    >>> run_id({"rolling_friction": 0.05, "size_distribution": "uniform"}, 3, {"seed": 3})
    'mu_r0.05-uniform-seed3-4d687b64'
    """
    words = [_readable(name, value) for name, value in varied.items()]
    return "-".join([*words, f"seed{seed}", parameters.fingerprint(identity)])


def _readable(name: str, value: Any) -> str:
    number = f"{value:g}" if isinstance(value, float) else str(value)
    return re.sub(r"[^\w.+]", "_", f"{SHORT_NAMES.get(name, name)}{number}")
