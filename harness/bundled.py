"""The studies and results that come along: beside the packages in a checkout, within them where it is installed."""

from __future__ import annotations

import difflib
from pathlib import Path

from harness.errors import InputError
from harness.study import STUDY_COPY

SUFFIX = ".toml"


def bundled_studies() -> dict[str, Path]:
    """Return name -> file of every study that comes along; a folder's name stands before those in it.

    >>> "demo" in bundled_studies()
    True
    """
    package = Path(__file__).resolve().parent
    for folder in (package.parent / "studies", package / "studies"):
        files = sorted(folder.rglob(f"*{SUFFIX}"), key=lambda file: (len(file.parts), file))
        if files:
            return {file.relative_to(folder).with_suffix("").as_posix(): file for file in files}
    raise InputError(f"{package / 'studies'}: the studies are missing from this installation; install forcechain again")


def bundled_study(name: str) -> Path:
    """Return the file of the study `name`; InputError with what there is where there is no such study."""
    studies = bundled_studies()
    if name not in studies:
        close = difflib.get_close_matches(name, studies, 1)
        hint = f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(studies)
        raise InputError(f"{name}: no study of this name comes along; {hint}")
    return studies[name]


def bundled_results(name: str) -> Path:
    """Return the folder of the results of study `name` that come along; InputError where there are none."""
    package = Path(__file__).resolve().parent
    for folder in (package.parent / "reference", package / "results"):
        if (folder / name / STUDY_COPY).is_file():
            return folder / name
    bundled_study(name)  # a name that is no study's at all
    raise InputError(f"{name}: no results of this study come along; forcechain run makes them")
