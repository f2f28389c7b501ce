"""Parameters of a run: names, units, defaults, limits, and the check that every door (study, script, table) uses."""

from __future__ import annotations

import difflib
import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class ParameterError(ValueError):
    """A parameter that is unknown, of the wrong kind, or outside its limits; the message is one line."""


class Parameter(NamedTuple):
    """One parameter: its default also tells its kind (int, float, str or bool)."""

    name: str
    default: Any
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    choices: tuple[str, ...] = ()

    def check(self, value: Any) -> Any:
        """Return `value` as this parameter's kind; ParameterError when it does not fit."""
        kind = type(self.default)
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if kind is int and isinstance(value, float) and value.is_integer():
            value = int(value)
        if type(value) is not kind:
            raise ParameterError(f"{self.name}: expected {self.expected()}, found {value!r}")
        if self.choices and value not in self.choices:
            raise ParameterError(f"{self.name}: expected {self.expected()}, found {value!r}")
        if kind in (int, float):
            too_low = value < self.low or (value == self.low and not self.low_allowed)
            if too_low or value > self.high or not math.isfinite(value):
                raise ParameterError(f"{self.name}: expected {self.expected()}, found {value!r}")
        return value

    def expected(self) -> str:
        """Describe the admissible values in words."""
        if self.choices:
            return "one of " + ", ".join(repr(choice) for choice in self.choices)
        words = {int: "a whole number", float: "a number", str: "a string", bool: "true or false"}[type(self.default)]
        if math.isfinite(self.low):
            words += f" {'from' if self.low_allowed else 'above'} {self.low:g}"
        if math.isfinite(self.high):
            words += f" up to {self.high:g}"
        return words + (f" [{self.unit}]" if self.unit not in ("", "-") else "")


MATERIAL = (
    Parameter("particle_count", 5098, "-", "number of discs", 10, 10_000_000),
    Parameter(
        "size_distribution",
        "bidisperse",
        "",
        "radii: two sizes in equal numbers, or uniform between them",
        choices=("bidisperse", "uniform"),
    ),
    Parameter("smallest_radius", 0.76e-3, "m", "smallest radius", 0, 1, False),
    Parameter("largest_radius", 1.52e-3, "m", "largest radius", 0, 1, False),
    Parameter("normal_stiffness", 1.05e5, "N/m", "normal stiffness of every contact", 0, math.inf, False),
    Parameter("tangential_stiffness_ratio", 0.5, "-", "tangential over normal stiffness", 0, 10, False),
    Parameter("rolling_stiffness_ratio", 0.5, "-", "rolling stiffness over normal stiffness and radius squared", 0, 10),
    Parameter(
        "rolling_stiffness_radius",
        "pair",
        "",
        "radius squared of the rolling stiffness: the product of the pair's radii, or the mean radius squared",
        choices=("pair", "mean"),
    ),
    Parameter("friction", 0.7, "-", "coefficient of sliding friction between discs", 0, 10),
    Parameter("rolling_friction", 0.2, "-", "largest moment over (smaller radius x normal force)", 0, 10),
    Parameter("wall_friction", 0.0, "-", "coefficient of sliding friction between discs and walls", 0, 10),
    Parameter("density", 2650.0, "kg/m^3", "mass over volume", 0, 1e9, False),
    Parameter(
        "shape",
        "sphere",
        "",
        "mass and inertia: spheres, or cylinders as high as the mean diameter",
        choices=("sphere", "cylinder"),
    ),
    Parameter(
        "mass",
        "equal",
        "",
        "masses: by size, or every disc the mean mass and a cylinder's inertia (only the inertial number matters)",
        choices=("true", "equal"),
    ),
)

LOADING = (
    Parameter("confining_stress", 7.0e2, "N/m", "stress on the side walls, force per length", 0, math.inf, False),
    Parameter("inertial_number", 1e-4, "-", "strain rate x sqrt(mean mass/confining stress)", 0, 1, False),
    Parameter("strain_rate", 0.0, "1/s", "strain rate; 0: what the inertial number asks for", 0, 1e9),
    Parameter("final_axial_strain", 0.1, "-", "axial strain at which the test ends", 0, 0.9, False),
    Parameter("damping", 0.2, "-", "local (non-viscous) damping of the discs", 0, 1),
    Parameter(
        "time_step_factor",
        0.0,
        "-",
        "time step over sqrt(smallest mass/normal stiffness); 0: the largest that is safe, 0.5 with equal masses",
        0,
        2,
    ),
)

SAMPLING = (
    Parameter("snapshot_strain_interval", 2.5e-4, "-", "axial strain from one snapshot to the next", 0, 1, False),
    Parameter(
        "dense_strain_intervals",
        "",
        "",
        "axial strains between which snapshots are denser, as BEGIN:END or several of them with commas",
    ),
    Parameter("dense_snapshot_interval", 5e-5, "-", "axial strain between two snapshots there", 0, 1, False),
    Parameter("history_strain_interval", 1e-4, "-", "axial strain from one history row to the next", 0, 1, False),
)

PREPARATION = (
    Parameter("preparation_friction", 0.0, "-", "friction between discs while the packing is prepared", 0, 10),
)

SEED = (Parameter("seed", 1, "-", "seed of the packing's random numbers", 0, 2**31 - 1),)

BIAXIAL = MATERIAL + LOADING + SAMPLING + PREPARATION + SEED

BED = (
    Parameter("bed_width_over_height", 2.0, "-", "width of the bed over its height", 0.1, 20),
    Parameter(
        "punch_width_over_bed_width", 0.12, "-", "width of the punch over that of the bed", 0, 0.8, low_allowed=False
    ),
    Parameter("punch_friction", 0.7, "-", "coefficient of sliding friction between discs and punch", 0, 10),
)
FEWEST_DISCS_UNDER_PUNCH = 3  # mean diameters; a narrower punch is a needle

# Settlement over the punch's width takes the place of the axial strain, in the names too: they are those of the format.
_PUNCH_CHANGES: dict[str, dict[str, Any]] = {
    "particle_count": {"default": 38849},
    # Under a punch the bed bears tens of times what confines it: with this, about as much as in the biaxial test.
    "confining_stress": {"default": 40.0, "meaning": "pressure on the bed's free surface, force per length"},
    "inertial_number": {
        "default": 1e-3,  # under the punch, where the stress is larger, it is several times smaller
        "meaning": "punch velocity/punch width x sqrt(mean mass/confining stress)",
    },
    "strain_rate": {"meaning": "punch velocity over punch width; 0: what the inertial number asks for"},
    "final_axial_strain": {"meaning": "settlement over punch width at which the test ends"},
    "snapshot_strain_interval": {
        "default": 5e-4,
        "meaning": "settlement over punch width from one snapshot to the next",
    },
    "dense_strain_intervals": {
        "meaning": "settlements over punch width between which snapshots are denser, as BEGIN:END with commas",
    },
    "dense_snapshot_interval": {"meaning": "settlement over punch width between two snapshots there"},
    "history_strain_interval": {"meaning": "settlement over punch width from one history row to the next"},
}
PUNCH = tuple(parameter._replace(**_PUNCH_CHANGES.get(parameter.name, {})) for parameter in BIAXIAL) + BED

TESTS = {"biaxial": BIAXIAL, "punch": PUNCH}

# One packing serves every run that agrees in these: the rest (friction, masses, rates, sampling) does not reach it.
PACKING_NAMES = (
    "particle_count",
    "size_distribution",
    "smallest_radius",
    "largest_radius",
    "normal_stiffness",
    "confining_stress",
    "preparation_friction",
    "seed",
)


def check(given: Mapping[str, Any], table: tuple[Parameter, ...] = BIAXIAL) -> dict[str, Any]:
    """Return every parameter of `table`, defaults filled in, each value checked.

    Raises ParameterError (one line: name, expected, found, what to do) for an unknown name or an inadmissible value.

    >>> check({"rolling_friction": 0.05})["rolling_friction"]
    0.05
    >>> check({"roling_friction": 0.05})
    Traceback (most recent call last):
        ...
    yade_scripts.parameters.ParameterError: unknown parameter 'roling_friction'; did you mean 'rolling_friction'?
    """
    known = {parameter.name: parameter for parameter in table}
    for name in given:
        if name not in known:
            close = difflib.get_close_matches(str(name), known, 1)
            hint = f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(known)
            raise ParameterError(f"unknown parameter {name!r}; {hint}")
    values = {name: parameter.check(given.get(name, parameter.default)) for name, parameter in known.items()}
    if "largest_radius" in values and values["largest_radius"] < values["smallest_radius"]:
        raise ParameterError(
            f"largest_radius: expected at least smallest_radius = {values['smallest_radius']:g} m, "
            f"found {values['largest_radius']:g}"
        )
    if "dense_strain_intervals" in values:
        strain_intervals(values["dense_strain_intervals"])
    if "punch_width_over_bed_width" in values:
        _check_punch_width(values)
    return values


def _check_punch_width(values: Mapping[str, Any]) -> None:
    # A disc of a dense packing takes about the square of its diameter.
    bed = math.sqrt(values["particle_count"] * values["bed_width_over_height"])
    share = values["punch_width_over_bed_width"]
    if share * bed < FEWEST_DISCS_UNDER_PUNCH:
        raise ParameterError(
            f"punch_width_over_bed_width: expected at least {FEWEST_DISCS_UNDER_PUNCH / bed:.2g}, a punch "
            f"{FEWEST_DISCS_UNDER_PUNCH} discs wide on this bed of about {bed:.0f}, found {share:g}"
        )


def strain_intervals(text: str) -> list[tuple[float, float]]:
    """Read strain intervals written as BEGIN:END, several of them with commas; ParameterError where they are not.

    >>> strain_intervals("0.04:0.05, 0.08:0.09")
    [(0.04, 0.05), (0.08, 0.09)]
    """
    intervals = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        try:
            begin, end = (float(strain) for strain in part.split(":"))
        except ValueError:
            begin, end = 1.0, 0.0
        if not 0 <= begin < end <= 1:
            raise ParameterError(
                "dense_strain_intervals: expected BEGIN:END with 0 <= BEGIN < END <= 1, several of them with commas, "
                f"found {part!r}"
            )
        intervals.append((begin, end))
    return intervals


def fingerprint(values: Mapping[str, Any]) -> str:
    """Eight hexadecimal digits that change with any value.

    >>> fingerprint({"a": 1.0, "b": 2}) == fingerprint({"b": 2, "a": 1.0})
    True
    """
    text = json.dumps(dict(values), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:8]
