"""Points of a column's equilibrium path: the walk that collects them, and the arrays and energies they become."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, freeze
from forcechain.theory.column import Column, Response
from forcechain.theory.history import Ending


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnPath:
    """Equilibrium path of a column, arrays read-only; n_points first.

    Attributes:
        angles: (n_points, N-1) buckling angles t of the contacts [rad].
        axial_force: (n_points,) [N].
        axial_displacement_over_R: (n_points,).
        normal_displacement_over_R: (n_points, N-1).
        rotations: (n_points, N) [rad].
        lateral_displacement_over_R: (n_points, N).
        contact_moment: (n_points, N-1) on the next particle [N m].
        lateral_force: (n_points, N) against the displacement [N].
        moment_plastic, lateral_plastic: (n_points, N-1), (n_points, N) whether each slider slipped in the last step.
        falling: (n_points,) whether the displacement fell while loading: the force snaps down under its control.
        unloading: (n_points,) whether the point belongs to the unloading leg.
        work, stored, moment_dissipation, lateral_dissipation: (n_points,) [J], increments by the trapezoidal rule.
        ending: why the path ended.
    """

    angles: FloatArray
    axial_force: FloatArray
    axial_displacement_over_R: FloatArray  # noqa: N815
    normal_displacement_over_R: FloatArray  # noqa: N815
    rotations: FloatArray
    lateral_displacement_over_R: FloatArray  # noqa: N815
    contact_moment: FloatArray
    lateral_force: FloatArray
    moment_plastic: BoolArray
    lateral_plastic: BoolArray
    falling: BoolArray
    unloading: BoolArray
    work: FloatArray
    stored: FloatArray
    moment_dissipation: FloatArray
    lateral_dissipation: FloatArray
    ending: Ending

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(*(getattr(self, name) for name in self.__dataclass_fields__ if name != "ending"))


@dataclass(slots=True)
class Walk:
    """The state a walk along the path carries, and the points it leaves behind."""

    column: Column
    y: FloatArray
    phi: float
    plastic_rotation: FloatArray
    plastic_lateral: FloatArray
    points: list[tuple[FloatArray, float, FloatArray, FloatArray, Response, bool]] = field(default_factory=list)


def as_path(walk: Walk, perfect: bool, ending: Ending) -> ColumnPath:
    """Turn the points into arrays and add up the energies."""
    column, chain = walk.column, walk.column.chain
    kn, R = chain.kn, chain.R
    y = np.array([point[0] for point in walk.points])
    phi = np.array([point[1] for point in walk.points])
    plastic_rotation = np.array([point[2] for point in walk.points])
    plastic_lateral = np.array([point[3] for point in walk.points])
    w, u = y[:, 0::2], y[:, 1::2]
    sines = np.diff(u, axis=1) / 2 + column.start_sines
    cosines = np.sqrt(1 - sines * sines)
    d = phi[:, None] * cosines
    moment = np.array([point[4].moment for point in walk.points])
    lateral = np.array([point[4].lateral for point in walk.points])
    shortening = (2 * column.start_cosines - (2 - d) * cosines).sum(axis=1)
    tau = np.diff(u, axis=1) - w[:, :-1] - w[:, 1:]
    stored = (d**2).sum(axis=1) + column.kFC * (tau**2).sum(axis=1)
    stored += column.kr * ((np.diff(w, axis=1) - plastic_rotation) ** 2).sum(axis=1)
    stored += column.ks * ((u - plastic_lateral) ** 2).sum(axis=1)
    begin = (column.N - 1) * phi[0] ** 2 / 2 if perfect else 0.0  # stage 1a

    def added(force: FloatArray, motion: FloatArray) -> FloatArray:
        steps = (force[1:] + force[:-1]) / 2 * np.diff(motion, axis=0)
        steps = steps if steps.ndim == 1 else steps.sum(axis=1)
        return np.concatenate(([0.0], np.cumsum(steps)))

    unloading = np.array([point[5] for point in walk.points])
    falling = np.concatenate(([False], np.diff(shortening) < 0)) & ~unloading
    unit = kn * R * R
    return ColumnPath(
        angles=np.arcsin(sines),
        axial_force=kn * R * phi,
        axial_displacement_over_R=shortening,
        normal_displacement_over_R=d,
        rotations=w,
        lateral_displacement_over_R=u,
        contact_moment=unit * moment,
        lateral_force=kn * R * lateral,
        moment_plastic=np.array([point[4].moment_slips for point in walk.points]),
        lateral_plastic=np.array([point[4].lateral_slips for point in walk.points]),
        falling=falling,
        unloading=unloading,
        work=unit * (begin + added(phi, shortening)),
        stored=unit * stored / 2,
        moment_dissipation=unit * added(moment, plastic_rotation),
        lateral_dissipation=unit * added(lateral, plastic_lateral),
        ending=ending,
    )
