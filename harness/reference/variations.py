"""Studies that change one thing, held against the study of the page; the table is kept beside its results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from harness.analysing.buckling_data import Analysis
from harness.comparing.variations import LEGEND, cells, vary
from harness.reference.page import VARIATIONS
from harness.reference.printed import printed_case
from yade_scripts.run_folder import write


def keep_variations(analysis: Analysis, others: Mapping[str, Analysis]) -> Path:
    """Hold `others` against the study's case of the printed numbers, write the table beside its results; its path.

    Raises InputError as `vary` does.
    """
    found = vary(analysis, others, printed_case(analysis))
    header, rows = cells(found)
    content = {
        "case": found.case,
        "seeds": list(found.seeds),
        "header": list(header),
        "rows": [list(row) for row in rows],
        "changes": {name: list(words) for name, words in found.changes.items()},
        "legend": " ".join(LEGEND.split()),
    }
    write(analysis.directory, VARIATIONS, (json.dumps(content, indent=1) + "\n").encode())
    return analysis.directory / VARIATIONS
