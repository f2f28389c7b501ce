"""How often a calibration's 95 % intervals hold the truth: trials on data made from the model with noise.

Both columns: the perfect one with the paper's shift, from its state at the first angle, and the imperfect one. Run by
hand, `python benchmarks/calibration_coverage.py 400`; the tests make the same trials a hundred times.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from calibration_data import coverage  # the test's own data

from forcechain.calibration import Column

if __name__ == "__main__":
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for column in Column:
        for parameter, held in coverage(column, trials).items():
            print(f"{column.value:10s} {parameter:28s} {held} of {trials}: {held / trials:.1%}")
