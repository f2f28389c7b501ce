"""What the paper prints of its own simulation, as references with tolerance, unit and source.

Tordesillas and Muthuswamy, On the modeling of confined buckling of force chains, J. Mech. Phys. Solids 57 (2009)
706-727.
One simulation each, without error bars: a floor says how far a faithful repetition may lie from the print, and why.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MEAN_RADIUS = 1.14e-3  # m, Table 3
PARTICLE_COUNT = 5098

# The conditions under which the numbers below were printed; the number of discs is stated, not demanded.
CONDITIONS: Mapping[str, float] = {
    "friction": 0.7,
    "rolling_friction": 0.2,
    "normal_stiffness": 1.05e5,
    "tangential_stiffness_ratio": 0.5,
    "rolling_stiffness_ratio": 0.5,
    "confining_stress": 7.0e2,
    "smallest_radius": 0.76e-3,
    "largest_radius": 1.52e-3,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A printed number: value, the floor of its tolerance, unit, where it stands, and why the floor is what it is."""

    quantity: str
    words: str
    value: float
    unit: str
    floor: float
    source: str
    floor_reason: str
    upper_bound: bool = False  # the paper gives only "less than"


PRINTED = (
    Reference(
        quantity="solid_fraction",
        words="solid fraction, prepared",
        value=0.858,
        unit="-",
        floor=0.015,
        source="section 5.1",
        floor_reason="the way of preparation is not printed; walls loosen the layer beside them, smaller samples more",
    ),
    Reference(
        quantity="coordination",
        words="coordination number, prepared",
        value=4.3,
        unit="-",
        floor=0.3,
        source="section 5.1",
        floor_reason="whether discs without contact count is not printed, and moves it by this much",
    ),
    Reference(
        quantity="peak_stress_ratio",
        words="peak stress ratio",
        value=0.66,
        unit="-",
        floor=0.066,
        source="section 5.1",
        floor_reason="a tenth: loading rate, damping and servo are not printed",
    ),
    Reference(
        quantity="strain_at_peak",
        words="axial strain at the peak",
        value=0.05,
        unit="-",
        floor=0.015,
        source="section 5.1",
        floor_reason="the curve is flat at its top; the first printed drop starts at 0.046, before the printed peak",
    ),
    Reference(
        quantity="initial_buckling_angle_deg",
        words="initial buckling angle, mean",
        value=14.0,
        unit="deg",
        floor=3.0,
        source="section 5.1.1",
        floor_reason="the rule that cuts a chain into segments is not printed, and moves it by 1 to 3 degrees",
    ),
    Reference(
        quantity="buckling_angle_growth_deg",
        words="growth of the buckling angle",
        value=10.0,
        unit="deg",
        floor=5.0,
        source="section 5.3",
        floor_reason="printed as 'of the order of'",
    ),
    Reference(
        quantity="lateral_force_N",
        words="lateral force, mean",
        value=2.9,
        unit="N",
        floor=0.6,
        source="section 5.2",
        floor_reason="a fifth: follows the choice of segments as the initial angle does",
    ),
    Reference(
        quantity="sliding_share_percent",
        words="segments that buckle by sliding inside the chain",
        value=5.0,
        unit="%",
        floor=0.0,
        source="section 2.2",
        floor_reason="printed as 'less than'",
        upper_bound=True,
    ),
)

# Table 1: percentages of buckled segments by class, over the first three drops.
TABLE_1: Mapping[float, tuple[float, float, float, float]] = {
    0.2: (7.1, 14.8, 44.1, 34.0),
    0.05: (1.2, 39.2, 21.7, 37.9),
    0.02: (0.0, 52.7, 18.8, 28.5),
}
CLASS_WORDS = {
    1: "both elastic",
    2: "support and chain moment together",
    3: "support first",
    4: "chain moment first",
}


def departures(parameters: Mapping[str, Any]) -> list[str]:
    """List in words each parameter in which a run departs from the conditions of the printed numbers.

    >>> departures({**CONDITIONS, "rolling_friction": 0.05})
    ['rolling_friction 0.05, the paper 0.2']
    """
    found = []
    for name, printed in CONDITIONS.items():
        value = parameters.get(name)
        if value is None:
            found.append(f"{name} unknown, the paper {printed:g}")
        elif abs(value - printed) > 1e-9 * abs(printed):
            found.append(f"{name} {value:g}, the paper {printed:g}")
    return found
