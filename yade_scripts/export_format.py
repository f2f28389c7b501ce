"""Run-folder format 1: the one place that names its files, columns, units and wall numbers.

Plain Python, imported by the scripts inside YADE and by the harness's reader. SI units; angles in radians.
A snapshot is one `.npz` (arrays named `particle_<column>` and `contact_<column>`, scalars as in `SNAPSHOT_SCALARS`) or
a pair of CSV tables with the bare column names and a row in `snapshots.csv`.
"""

from __future__ import annotations

from typing import NamedTuple

FORMAT = 1

MANIFEST = "run.json"  # written last: its presence says that the run has ended
PARAMETERS = "parameters.json"  # what the run was asked to do
PROGRESS = "progress.json"  # rewritten every second while the run goes on
HISTORY = "history.csv"
SNAPSHOTS = "snapshots"
SNAPSHOT_INDEX = "snapshots.csv"
LOG = "yade.log"

STATUS_DONE = "done"
STATUS_FAILED = "failed"


class Column(NamedTuple):
    """One column of a table: its name, unit, whether it holds whole numbers, and what it means."""

    name: str
    unit: str
    integer: bool
    meaning: str


PARTICLE_COLUMNS = (
    Column("id", "-", True, "0 to n-1"),
    Column("radius", "m", False, "radius"),
    Column("x", "m", False, "centre"),
    Column("y", "m", False, "centre"),
    Column("rotation", "rad", False, "rotation about z since the start, unwrapped"),
    Column("vx", "m/s", False, "velocity"),
    Column("vy", "m/s", False, "velocity"),
    Column("spin", "rad/s", False, "angular velocity about z"),
)

CONTACT_COLUMNS = (
    Column("id1", "-", True, "a particle"),
    Column("id2", "-", True, "a particle, or a wall (negative)"),
    Column("x", "m", False, "contact point"),
    Column("y", "m", False, "contact point"),
    Column("nx", "-", False, "unit normal from id1 to id2"),
    Column("ny", "-", False, "unit normal from id1 to id2"),
    Column("overlap", "m", False, "overlap, positive in contact"),
    Column("fn", "N", False, "normal force, compression positive; the force on id2 is fn n + ft t"),
    Column("ft", "N", False, "tangential force on id2 along the normal turned by +90 degrees"),
    Column("moment", "N m", False, "contact moment about z, on id2"),
    Column("kn", "N/m", False, "normal stiffness"),
    Column("kt", "N/m", False, "tangential stiffness"),
    Column("kr", "N m/rad", False, "rolling stiffness; zero where the contact bears no moment"),
    Column("friction", "-", False, "coefficient of sliding friction"),
    Column("rolling_limit", "m", False, "largest moment divided by the normal force"),
)

SNAPSHOT_SCALARS = ("axial_strain", "time", "iteration")

SNAPSHOT_INDEX_COLUMNS = (
    Column("index", "-", True, "number of the snapshot, as in the names of its files"),
    Column("axial_strain", "-", False, "axial strain, compression positive"),
    Column("time", "s", False, "simulated time"),
)

HISTORY_COLUMNS = (
    Column("axial_strain", "-", False, "engineering strain along y, compression positive"),
    Column("lateral_strain", "-", False, "engineering strain along x, compression positive"),
    Column("axial_stress", "N/m", False, "mean of the bottom and top walls' force over the length they confine"),
    Column("lateral_stress", "N/m", False, "mean of the left and right walls' force over the height they confine"),
    Column("stress_ratio", "-", False, "(axial - lateral)/(axial + lateral)"),
    Column("solid_fraction", "-", False, "area of the discs over the area between the walls"),
    Column("coordination", "-", False, "contact ends a disc, every disc and wall contact counted"),
    Column("unbalanced_force", "-", False, "mean resultant force on a disc over the mean contact force"),
    Column("kinetic_energy", "J", False, "of all discs, rotation included"),
    Column("elastic_energy", "J", False, "stored in all contacts"),
    Column("servo_error", "-", False, "mean of lateral over confining stress since the row before, minus 1"),
    Column("time", "s", False, "simulated time"),
    Column("iteration", "-", True, "step number"),
)

WALLS = {-1: "left", -2: "right", -3: "bottom", -4: "top", -5: "punch"}
LOWEST_WALL = min(WALLS)


def names(columns: tuple[Column, ...]) -> list[str]:
    """Names of `columns`, in order.

    >>> names(SNAPSHOT_INDEX_COLUMNS)
    ['index', 'axial_strain', 'time']
    """
    return [column.name for column in columns]


def snapshot_name(index: int) -> str:
    """Stem of the files of snapshot number `index`.

    >>> snapshot_name(123)
    '000123'
    """
    return f"{index:06d}"
