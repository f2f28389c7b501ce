"""The model fitted to what was observed, with intervals: the only place where theory and observation meet.

`three_particle`: the paper's column against averaged three-particle segments. `column_fit`: what such a fit compares.
`estimates`: intervals, profiles, goodness. `resampling`: the data, and their averages resampled. `bounded_fit`: many
small fits at once. `long_columns`: columns of more than three particles. `result`: what comes out.
"""

from forcechain.calibration.estimates import CALIBRATED, CONFIDENCE, FITTED
from forcechain.calibration.long_columns import LongColumn, LongEstimate, calibrate_long
from forcechain.calibration.resampling import MEASURES, SegmentHistories
from forcechain.calibration.result import Calibration, Column, Estimate, Goodness, Identified, Interval
from forcechain.calibration.three_particle import calibrate

__all__ = [
    "CALIBRATED",
    "CONFIDENCE",
    "FITTED",
    "MEASURES",
    "Calibration",
    "Column",
    "Estimate",
    "Goodness",
    "Identified",
    "Interval",
    "LongColumn",
    "LongEstimate",
    "SegmentHistories",
    "calibrate",
    "calibrate_long",
]
