"""What a calibration gives: estimates with intervals and how well they are known, and how well the model then fits."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from forcechain.arrays import FloatArray, freeze
from forcechain.theory.parameters import ChainParameters


class Column(StrEnum):
    """Which column of the model the data are held against."""

    PERFECT = "perfect"  # straight at first; data start at its state at the mean initial angle, as in the paper
    IMPERFECT = "imperfect"  # unloaded at the mean initial angle (appendix A of the paper)


class Identified(StrEnum):
    """What the data tell about a parameter."""

    YES = "identified"
    BOUNDED_BELOW = "bounded below"
    AT_BOUND = "at bound"
    NO = "not identified"
    MEASURED = "measured"

    @property
    def meaning(self) -> str:
        """One line: what it means for the value."""
        return _MEANINGS[self]


_MEANINGS = {
    Identified.YES: "the data bound it on both sides",
    Identified.BOUNDED_BELOW: "only bounded below: its interval reaches the stiffness from which the lateral support "
    "has yielded before the first angle of the data, and there every value that (30) admits fits as well",
    Identified.AT_BOUND: "the fit would go on beyond what is admissible, by (30) or by 0: the model does not describe "
    "these data with an admissible value",
    Identified.NO: "the data do not tell: the interval is all that is admissible",
    Identified.MEASURED: "measured directly, not fitted: the mean lateral force over R",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """95 % interval, both ends within what is admissible."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Length."""
        return self.high - self.low


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One calibrated parameter, over the normal stiffness.

    Attributes:
        name: as in `ChainParameters`.
        value: best estimate.
        by_segments: interval from bootstrap samples of the segments.
        by_runs: interval from leaving out run after run, with Student's t for their number; None with one run.
        interval: the wider of both, the one to quote.
        standard_error: the larger of that over segments and that over runs.
        identified: what the data tell.
        determined_by: measure -> share of the data's information about it, in all 1; empty where there is none.
        profile_value, profile_sum: (n_points,) values held fixed, and the least sum of squares then; empty if measured.
    """

    name: str
    value: float
    by_segments: Interval
    by_runs: Interval | None
    interval: Interval
    standard_error: float
    identified: Identified
    determined_by: dict[str, float]
    profile_value: FloatArray
    profile_sum: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.profile_value, self.profile_sum)


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """How well one measure is met: root-mean-square difference over the mean of the data's absolute values.

    Displacement and rotation are compared by their growth since the first increment. `calibrated` and `reference` are
    for the calibrated and for the given parameters, each with its interval over resamples; `sum_of_squares` is the
    measure's part in the fit, about 1 where model and data differ by one standard error.
    """

    measure: str
    calibrated: float
    calibrated_interval: Interval
    reference: float
    reference_interval: Interval
    sum_of_squares: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        column: which column was fitted.
        parameters: the calibrated set, with the imperfection.
        estimates: kFC, ks and ls, in the order of `CALIBRATED`.
        correlation: (3, 3) of the estimates over resampled segments; not a number where one never moves.
        goodness: one for each of `FITTED_MEASURES`.
        sum_of_squares: at the best fit; about the number of measures for a model that is right.
        bound: largest (2 K + ks)/kn that (30) admits.
        n_segments, n_runs: what was averaged.
        left_out: increments not compared, because the imperfect column has no load below its first angle.
    """

    column: Column
    parameters: ChainParameters
    estimates: tuple[Estimate, ...]
    correlation: FloatArray
    goodness: tuple[Goodness, ...]
    sum_of_squares: float
    bound: float
    n_segments: int
    n_runs: int
    left_out: int

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.correlation)
