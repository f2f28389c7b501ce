"""A column of N particles with every degree of freedom of (4) to (8): equations, tangent, buckling modes.

Unknown are the rotations w and the lateral displacements u (over R) of all particles; u is 0 at both ends, so the
paper's condition that the sines sum to zero holds by construction: with i the imperfect start, sin t - sin t_i is half
the difference of u across a contact. The overlaps follow from dV/dd = 0: d = (F/(kn R)) cos t. With all stiffnesses in
units of kn, phi = F/(kn R), and tau, M, T, q tangential displacement, moment, shear and lateral force over R:

    tau = u' - u - (w + w')                                                   (6)
    T = kFC tau - phi tan t + phi^2 sin t/2                                   dV/du across a contact, with (8)
    M = kr (w' - w - plastic rotation), at most mu_r d                        (2), (16)
    q = ks (u - plastic displacement), at most ls                             (3), (17)
    -kFC (tau before + tau after) + M before - M after = 0                    dV/dw
    T before - T after + q = 0                                                dV/du

Neighbours alone are coupled: the tangent is banded, one step costs O(N).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh, solve_banded

from forcechain.arrays import BoolArray, FloatArray, float_array, freeze
from forcechain.theory.arcs import Chain
from forcechain.theory.equilibrium import Number, overlap_elastic
from forcechain.theory.parameters import ChainParameters

SMALLEST, LARGEST = 3, 200
BAND = 3  # coupled unknowns to each side of the diagonal


@dataclass(frozen=True, slots=True, kw_only=True)
class BucklingModes:
    """All modes of the straight column, lowest load first; arrays read-only.

    Attributes:
        critical_force: (N-2,) [N]; NaN for a mode too stiff to occur (its overlap would exceed a radius).
        critical_displacement_over_R: (N-2,).
        stiffness: (N-2,) eigenvalue L [N/m]: d (2 - d) = L/kn, the generalisation of (14).
        angles: (N-2, N-1) buckling angles of each mode, the largest of size 1, the first positive.
        lateral_displacement: (N-2, N) over R, to the same scale.
        rotations: (N-2, N), to the same scale.
    """

    critical_force: FloatArray
    critical_displacement_over_R: FloatArray  # noqa: N815
    stiffness: FloatArray
    angles: FloatArray
    lateral_displacement: FloatArray
    rotations: FloatArray

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(*(getattr(self, name) for name in self.__dataclass_fields__))


def particle_count(n_particles: int) -> int:
    """Return `n_particles`; ValueError unless it is a whole number from 3 to 200."""
    if isinstance(n_particles, bool) or int(n_particles) != n_particles or not SMALLEST <= n_particles <= LARGEST:
        raise ValueError(f"n_particles: expected a whole number from {SMALLEST} to {LARGEST}, found {n_particles}")
    return int(n_particles)


def elastic_hessian(parameters: ChainParameters, n_particles: int) -> tuple[FloatArray, FloatArray]:
    """Second derivatives of stored energy and of axial shortening of the straight column, over R^2.

    Returns (2N-2, 2N-2) matrices over the rotations of all particles and the lateral displacements of the inner ones:
    stored energy (4) [N/m], and the geometric matrix that kn d (2 - d) multiplies.
    """
    chain, N = Chain.of(parameters), particle_count(n_particles)
    across = np.diff(np.eye(N), axis=0)  # (N-1, N): next minus this
    around = np.abs(across)
    inner = slice(1, N - 1)
    kr = chain.kr if chain.mu_r > 0 else 0.0  # a moment without strength has no stiffness
    ww = chain.kFC * around.T @ around + kr * across.T @ across
    wu = -chain.kFC * around.T @ across[:, inner]
    uu = chain.kFC * across[:, inner].T @ across[:, inner] + chain.ks * np.eye(N - 2)
    stored = np.block([[ww, wu], [wu.T, uu]])
    shortening = np.zeros_like(stored)
    shortening[N:, N:] = across[:, inner].T @ across[:, inner] / 4
    return stored, shortening


def mode_stiffness(
    wave: Number,
    chain_tangential_stiffness: Number,
    rolling_stiffness: Number,
    lateral_stiffness: Number,
) -> tuple[Number, Number]:
    """Stiffness L [N/m] of a straight column against a sine wave, and the rotation that goes with it.

    With u = sin(a i) and w = W cos(a i) for particle i, every balance of `elastic_hessian`'s form holds, also at the
    ends where a = k pi/(N - 1), k = 1 to N - 2:

        W = kFC sin a/(kFC (1 + cos a) + kr (1 - cos a)),    L = 4 kFC + 2 (ks - 2 kFC W sin a)/(1 - cos a).

    So all modes are known in closed form. For N = 3, a = pi/2, L/2 is 2 K + ks of (14).

    Args:
        wave: a [rad], phase from one particle to the next, above 0 and below pi.
        chain_tangential_stiffness, rolling_stiffness, lateral_stiffness: kFC, kr, ks [N/m].

    >>> stiffness, _ = mode_stiffness(np.pi / 2, 1.0, 1.0, 0.0)
    >>> float(stiffness.round(12))
    2.0
    """
    kFC, kr, ks = chain_tangential_stiffness, rolling_stiffness, lateral_stiffness
    sine, cosine = np.sin(wave), np.cos(wave)
    W = kFC * sine / (kFC * (1 + cosine) + kr * (1 - cosine))
    return 4 * kFC + 2 * (ks - 2 * kFC * W * sine) / (1 - cosine), W


def stiffness_by_eigenproblem(parameters: ChainParameters, n_particles: int) -> FloatArray:
    """(N-2,) stiffness L [N/m] of all modes, rising, by a symmetric eigenproblem: the check of `mode_stiffness`.

    The rotations are eliminated from the elastic Hessian about the straight column; the eigenvalues of what remains,
    against the geometric matrix, are L. Raises ValueError as `buckling_modes` does.
    """
    N = particle_count(n_particles)
    stored, shortening = elastic_hessian(parameters, N)
    # Without moments the particles may all roll on each other like gears at no cost: the least rotation is taken.
    follow = -np.linalg.pinv(stored[:N, :N], hermitian=True) @ stored[:N, N:]
    condensed = stored[N:, N:] + stored[N:, :N] @ follow
    return np.asarray(eigh((condensed + condensed.T) / 2, shortening[N:, N:], eigvals_only=True))


def buckling_modes(parameters: ChainParameters, n_particles: int) -> BucklingModes:
    """Critical loads and shapes of all N-2 modes of the perfect column, in closed form (`mode_stiffness`).

    A mode of stiffness L costs nothing at the load where d (2 - d) = L/kn, F = kn R d. For N = 3 this is (14) and (15).

    Raises ValueError for arrays of parameters or a number of particles outside 3 to 200.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> float(buckling_modes(TABLE_3, 3).critical_force[0].round(9))
    10.942468405
    """
    chain, N = Chain.of(parameters), particle_count(n_particles)
    kr = chain.kr if chain.mu_r > 0 else 0.0  # a moment without strength has no stiffness
    wave = np.pi * np.arange(1, N - 1) / (N - 1)
    L, W = (np.asarray(values) for values in mode_stiffness(wave, chain.kFC, kr, chain.ks))
    rising = np.argsort(L, kind="stable")
    L, W, phase = L[rising], W[rising], wave[rising, None] * np.arange(N)
    u, w = np.sin(phase), W[:, None] * np.cos(phase)
    u[:, -1] = 0.0  # as sin(k pi) is
    angles = np.diff(u, axis=1) / 2
    scale = np.abs(angles).max(axis=1, keepdims=True)
    overlap = np.asarray(overlap_elastic(L / chain.kn))
    return BucklingModes(
        critical_force=chain.kn * chain.R * overlap,
        critical_displacement_over_R=(N - 1) * overlap,
        stiffness=L,
        angles=angles / scale,
        lateral_displacement=u / scale,
        rotations=w / scale,
    )


def imperfect_angles(
    parameters: ChainParameters, n_particles: int, mode: int = 0, angles: ArrayLike | None = None
) -> FloatArray:
    """(N-1,) angles of the unloaded column: as given, or the shape of `mode` with the parameters' imperfection.

    For N = 3 and mode 0 they are (ti, -ti), the paper's appendix. Raises ValueError for angles whose sines do not sum
    to zero (the ends would not be in line), not below 90 degrees, or of the wrong number, and for a mode that is none.
    """
    N = particle_count(n_particles)
    if angles is not None:
        given = float_array(angles, "imperfection angles", (N - 1,))
        if np.abs(given).max() >= np.pi / 2:
            raise ValueError(f"imperfection angles: expected below pi/2 rad, found {np.abs(given).max():g}")
        if abs(np.sin(given).sum()) > 1e-9:
            raise ValueError(
                f"imperfection angles: expected sines that sum to 0, so that the ends are in line, "
                f"found {np.sin(given).sum():.3g}"
            )
        return given
    if not 0 <= mode < N - 2:
        raise ValueError(f"mode: expected 0 to {N - 3} for {N} particles, found {mode}")
    shape = buckling_modes(parameters, N).angles[mode]
    angles_of_mode: FloatArray = np.arcsin(np.sin(float(parameters.imperfection)) * shape)
    return angles_of_mode


@dataclass(slots=True)
class Response:
    """Residual, tangent and internal forces at a trial state; stiffnesses and forces in units of kn."""

    residual: FloatArray  # (2N,) rotation and lateral balance of each particle in turn
    band: FloatArray  # (7, 2N) its derivative, in LAPACK's band storage
    by_load: FloatArray  # (2N,) derivative by phi
    moment: FloatArray  # (N-1,)
    lateral: FloatArray  # (N,)
    moment_slips: BoolArray  # (N-1,)
    lateral_slips: BoolArray  # (N,)
    gauge: float  # imbalance of the equation that a free gear-like rolling makes redundant; 0 without it


class Column:
    """The discrete column: dimensionless stiffnesses, imperfection, and the response to a trial state.

    A trial state is y = (w, u of each particle in turn), shape (2N,), and phi = F/(kn R).
    """

    def __init__(self, parameters: ChainParameters, n_particles: int, start_angles: FloatArray) -> None:
        """Keep stiffnesses over kn; a moment or support without strength has no stiffness."""
        chain = Chain.of(parameters)
        self.chain, self.N = chain, particle_count(n_particles)
        self.kFC, self.ks, self.ls, self.mu_r = (
            chain.kFC / chain.kn,
            chain.ks / chain.kn,
            chain.ls / chain.kn,
            chain.mu_r,
        )
        self.kr = chain.kr / chain.kn if chain.mu_r > 0 else 0.0
        self.start_sines = np.sin(start_angles)
        self.start_cosines = np.cos(start_angles)

    def sines(self, y: FloatArray) -> FloatArray:
        """Return sin t of every contact, shape (N-1,)."""
        return np.diff(y[1::2]) / 2 + self.start_sines

    def shortening(self, y: FloatArray, phi: float) -> float:
        """Axial displacement over R, (8)."""
        cosines = np.sqrt(1 - self.sines(y) ** 2)
        return float((2 * self.start_cosines - (2 - phi * cosines) * cosines).sum())

    def respond(self, y: FloatArray, phi: float, plastic_rotation: FloatArray, plastic_lateral: FloatArray) -> Response:
        """Return residual and tangent at (y, phi), sliders starting from the given plastic displacements."""
        N, kFC, kr, ks = self.N, self.kFC, self.kr, self.ks
        w, u = y[0::2], y[1::2]
        sine = self.sines(y)
        cosine = np.sqrt(1 - sine * sine)
        tangent = sine / cosine
        tau = np.diff(u) - w[:-1] - w[1:]
        T = kFC * tau - phi * tangent + phi * phi * sine / 2
        T_u = kFC - phi / (2 * cosine**3) + phi * phi / 4
        T_phi = -tangent + phi * sine

        moment = kr * (np.diff(w) - plastic_rotation)
        limit = self.mu_r * phi * cosine
        slips = np.abs(moment) > limit if kr > 0 else np.zeros(N - 1, dtype=bool)
        sign = np.sign(moment)
        M = np.where(slips, sign * limit, moment)
        M_w = np.where(slips, 0.0, kr)  # by the next rotation; minus that by this one
        M_u = np.where(slips, -sign * self.mu_r * phi * tangent / 2, 0.0)  # by the next u; minus that by this one
        M_phi = np.where(slips, sign * self.mu_r * cosine, 0.0)

        q = ks * (u - plastic_lateral)
        lateral_slips = np.abs(q) > self.ls
        q = np.clip(q, -self.ls, self.ls)
        q_u = np.where(lateral_slips, 0.0, ks)

        residual, by_load = np.zeros(2 * N), np.zeros(2 * N)
        rotation, lateral = residual[0::2], residual[1::2]
        rotation[:-1] += -kFC * tau - M
        rotation[1:] += -kFC * tau + M
        lateral[:-1] -= T
        lateral[1:] += T
        lateral += q
        by_load[0:-2:2] -= M_phi
        by_load[2::2] += M_phi
        by_load[1:-2:2] -= T_phi
        by_load[3::2] += T_phi

        band = np.zeros((2 * BAND + 1, 2 * N))
        d = band[BAND]  # band[BAND + row - column, column]
        # Derivatives of contact j's terms by w, u of particle j ("this") and j+1 ("next").
        d[0:-2:2] += kFC + M_w  # rotation of this by w of this: -kFC(-1) + kr
        d[2::2] += kFC + M_w
        band[BAND - 2, 2::2] += kFC - M_w  # rotation of this by w of next
        band[BAND + 2, 0:-2:2] += kFC - M_w  # rotation of next by w of this
        band[BAND - 1, 1:-2:2] += kFC + M_u  # rotation of this by u of this
        band[BAND - 3, 3::2] += -kFC - M_u  # rotation of this by u of next
        band[BAND + 1, 1:-2:2] += kFC - M_u  # rotation of next (row 2j+2) by u of this (column 2j+1)
        band[BAND - 1, 3::2] += -kFC + M_u  # rotation of next by u of next
        band[BAND + 1, 0:-2:2] += kFC  # lateral of this by w of this
        band[BAND - 1, 2::2] += kFC  # lateral of this (row 2j+1) by w of next (column 2j+2)
        band[BAND + 3, 0:-2:2] -= kFC  # lateral of next by w of this
        band[BAND + 1, 2::2] -= kFC  # lateral of next by w of next
        d[1:-2:2] += T_u
        d[3::2] += T_u
        band[BAND - 2, 3::2] -= T_u
        band[BAND + 2, 1:-2:2] -= T_u
        d[1::2] += q_u

        gauge = 0.0
        if kr == 0 or slips.all():  # all may roll like gears: hold the middle particle, whose balance then follows
            row = 2 * (N // 2)
            gauge = float(residual[row])
            residual[row] = 0.0
            by_load[row] = 0.0
            clear_row(band, row)
        for end in (1, 2 * N - 1):
            residual[end] = 0.0
            by_load[end] = 0.0
            clear_row(band, end)
        return Response(residual, band, by_load, M, q, slips, lateral_slips, gauge)


def clear_row(band: FloatArray, row: int) -> None:
    """Make `row` of a banded matrix that of the unit matrix: its unknown stays as it is."""
    size = band.shape[1]
    for column in range(max(0, row - BAND), min(size, row + BAND + 1)):
        band[BAND + row - column, column] = 1.0 if column == row else 0.0


def solve(band: FloatArray, *right: FloatArray) -> NDArray[np.float64]:
    """Solve the banded system for several right sides, (2N, n_sides); LinAlgError where it is singular."""
    return np.asarray(solve_banded((BAND, BAND), band, np.column_stack(right), check_finite=False))
