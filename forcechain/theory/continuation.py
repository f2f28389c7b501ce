"""The post-critical path of a column of N particles: arc-length continuation with a slider at every contact moment and
every lateral support.

Each step predicts along the tangent and corrects by Newton's method on the plane across it (Riks 1979, Int. J. Solids
Struct. 15, 529-551), with the exact banded tangent. Within a step the sliders are mapped back to their limits from the
last point, so every point fulfils equilibrium and yield conditions exactly; steps that do not converge are halved.
A path that cannot be continued says so in its `ending`; it never returns a point that is no equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError

from forcechain.arrays import FloatArray
from forcechain.theory.column import Column, Response, buckling_modes, imperfect_angles, particle_count, solve
from forcechain.theory.column_path import ColumnPath, Walk, as_path
from forcechain.theory.history import Ending
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import Status

TOLERANCE = 1e-13  # of the residual forces, over kn R
ROUNDING = 1e-11  # accepted where rounding lets Newton's method come no nearer
MOST_CORRECTIONS = 12
WANTED_CORRECTIONS = 4
FIRST_ANGLE = 1e-3  # rad, largest angle of the first point of a perfect column's buckled path
FIRST_STEP, LARGEST_STEP, SMALLEST_STEP = 0.01, 0.03, 1e-7
ALMOST = 1e-4  # a slider this near its limit is about to slip
UNLOADED = 1e-3  # of the force at the start of unloading
MOST_POINTS = 2000


def follow_column(
    parameters: ChainParameters,
    n_particles: int,
    *,
    mode: int = 0,
    imperfection_angles: ArrayLike | None = None,
    largest_angle: float = math.radians(40),
    unload: bool = False,
    largest_step: float = LARGEST_STEP,
) -> ColumnPath:
    """Load a column until one of its buckling angles reaches `largest_angle`; then unload it if asked to.

    Args:
        parameters: one set; a non-zero imperfection gives the unloaded column the shape of `mode`.
        n_particles: 3 to 200.
        mode: the mode a perfect column buckles in, or the shape of the imperfection; 0 has the lowest load.
        imperfection_angles: (N-1,) angles of the unloaded column [rad], instead of mode and imperfection.
        largest_angle: [rad].
        unload: whether to unload until the force vanishes.
        largest_step: arc length between points at most, in units of angle.

    Returns:
        ColumnPath; a perfect column's begins at the bifurcation. `ending` says whether all of it was reached.

    Raises:
        ValueError: arrays of parameters, N outside 3 to 200, no such mode, angles that are none, a column too stiff
            to buckle.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> path = follow_column(TABLE_3, 5, largest_angle=0.3)
    >>> path.ending.name, bool(np.isclose(path.angles[-1].max(), 0.3))
    ('REACHED', True)
    """
    N = particle_count(n_particles)
    if not 0 < largest_angle < math.pi / 2:
        raise ValueError(f"largest_angle: expected above 0 and below pi/2 rad, found {largest_angle:g}")
    if not largest_step > SMALLEST_STEP:
        raise ValueError(f"largest_step: expected above {SMALLEST_STEP:g}, found {largest_step:g}")
    start = imperfect_angles(parameters, N, mode, imperfection_angles)
    if np.abs(start).max() >= largest_angle:
        raise ValueError(
            f"largest_angle: expected above the imperfection's {np.abs(start).max():g} rad, found {largest_angle:g}"
        )
    column = Column(parameters, N, start)
    walk = Walk(column, np.zeros(2 * N), 0.0, np.zeros(N - 1), np.zeros(N))
    perfect = not start.any()
    if perfect:
        _bifurcate(walk, parameters, mode)
    ending = _walk_on(walk, largest_angle, largest_step, unloading=False)
    if unload and ending == Ending.REACHED:
        ending = _walk_on(walk, largest_angle, largest_step, unloading=True)
    return as_path(walk, perfect, ending)


def _bifurcate(walk: Walk, parameters: ChainParameters, mode: int) -> None:
    """Put the walk on the buckled branch of a perfect column, a small way along the mode."""
    column = walk.column
    modes = buckling_modes(parameters, column.N)
    if not math.isfinite(modes.critical_force[mode]):
        raise ValueError(f"column: {Status.TOO_STIFF.meaning}")
    y = np.zeros(2 * column.N)
    y[0::2], y[1::2] = modes.rotations[mode], modes.lateral_displacement[mode]
    phi = float(modes.critical_force[mode] / (column.chain.kn * column.chain.R))
    straight = column.respond(walk.y, phi, walk.plastic_rotation, walk.plastic_lateral)
    walk.points.append((walk.y, phi, walk.plastic_rotation, walk.plastic_lateral, straight, False))
    length = float(np.linalg.norm(y))
    corrected = _correct(walk, y * FIRST_ANGLE, phi, y / length, 0.0, FIRST_ANGLE * length)
    if corrected is None:
        raise ValueError(
            f"column: no buckled path begins at mode {mode}; the supports yield at once or too many modes "
            "share the load"
        )
    _accept(walk, *corrected[:3], False)


def _correct(
    walk: Walk,
    y: FloatArray,
    phi: float,
    normal: FloatArray,
    normal_phi: float,
    distance: float,
    centre: tuple[FloatArray, float] | None = None,
) -> tuple[FloatArray, float, Response, int] | None:
    """Newton's method for equilibrium on the plane normal . (y - centre) = distance; None where it fails."""
    centre_y, centre_phi = centre if centre is not None else (np.zeros_like(y), 0.0)
    column = walk.column
    best: tuple[FloatArray, float, Response, int] | None = None
    least = ROUNDING
    for correction in range(MOST_CORRECTIONS):
        if np.abs(column.sines(y)).max() >= 1:
            break
        response = column.respond(y, phi, walk.plastic_rotation, walk.plastic_lateral)
        off = float(normal @ (y - centre_y)) + normal_phi * (phi - centre_phi) - distance
        error = max(float(np.abs(response.residual).max()), abs(off), abs(response.gauge))
        if error < least:
            best, least = (y, phi, response, correction), error
        if error < TOLERANCE:
            break
        try:
            steps = solve(response.band, response.residual, response.by_load)
        except LinAlgError:
            break
        by_residual, by_load = steps[:, 0], steps[:, 1]
        slope = normal_phi - float(normal @ by_load)
        if slope == 0 or not np.isfinite(steps).all():
            break
        change = (float(normal @ by_residual) - off) / slope
        y = y - by_residual - change * by_load
        phi = phi + change
    return best


def _accept(walk: Walk, y: FloatArray, phi: float, response: Response, unloading: bool) -> None:
    """Move the walk to a converged point and let the sliders keep what they slipped."""
    column = walk.column
    if column.kr > 0:
        slipped = np.diff(y[0::2]) - response.moment / column.kr
        walk.plastic_rotation = np.where(response.moment_slips, slipped, walk.plastic_rotation)
    if column.ks > 0:
        slid = y[1::2] - response.lateral / column.ks
        walk.plastic_lateral = np.where(response.lateral_slips, slid, walk.plastic_lateral)
    walk.y, walk.phi = y, phi
    walk.points.append((y, phi, walk.plastic_rotation, walk.plastic_lateral, response, unloading))


def _tangent(response: Response, forward: tuple[FloatArray, float] | None) -> tuple[FloatArray, float]:
    """Unit tangent of the path, pointing along `forward`, or with it None towards growing load."""
    direction = -solve(response.band, response.by_load)[:, 0]
    norm = math.sqrt(float(direction @ direction) + 1)
    y, phi = direction / norm, 1 / norm
    if forward is not None and float(y @ forward[0]) + phi * forward[1] < 0:
        return -y, -phi
    return y, phi


def _elastic(walk: Walk) -> Response:
    """Return the response with every slider holding from here: the tangent of unloading."""
    column = walk.column
    return column.respond(walk.y, walk.phi, np.diff(walk.y[0::2]), walk.y[1::2])


def _first_tangent(walk: Walk, unloading: bool) -> tuple[FloatArray, float]:
    """Tangent along which a leg begins; LinAlgError for a column that nothing supports."""
    column = walk.column
    if unloading:
        tangent_y, tangent_phi = _tangent(_elastic(walk), None)
        ahead = column.shortening(walk.y + 1e-6 * tangent_y, walk.phi + 1e-6 * tangent_phi)
        sign = -1.0 if ahead > column.shortening(walk.y, walk.phi) else 1.0
        return sign * tangent_y, sign * tangent_phi
    if walk.points:
        return walk.y / math.sqrt(float(walk.y @ walk.y)), 0.0
    begin = column.respond(walk.y, walk.phi, walk.plastic_rotation, walk.plastic_lateral)
    walk.points.append((walk.y, walk.phi, walk.plastic_rotation, walk.plastic_lateral, begin, False))
    return _tangent(begin, None)


def _walk_on(walk: Walk, largest_angle: float, largest_step: float, *, unloading: bool) -> Ending:
    """Continue the path until the largest angle, or while unloading until the force vanishes."""
    column = walk.column
    try:
        tangent_y, tangent_phi = _first_tangent(walk, unloading)
    except LinAlgError:  # nothing supports the column
        return Ending.DEAD_END
    step = min(FIRST_STEP, largest_step)
    start_phi = walk.phi
    while len(walk.points) < MOST_POINTS:
        found = _correct(
            walk,
            walk.y + step * tangent_y,
            walk.phi + step * tangent_phi,
            tangent_y,
            tangent_phi,
            step,
            (walk.y, walk.phi),
        )
        if found is None or not _moves_on(walk, found, step):
            step /= 2
            if step >= SMALLEST_STEP:
                continue
            found = None if unloading else _past_corner(walk)
            if found is None:
                return Ending.DEAD_END
            step = FIRST_STEP
        y, phi, response, corrections = found
        if unloading and phi < UNLOADED * start_phi:
            return _land_on_zero_force(walk, tangent_y, tangent_phi)
        sines = np.abs(column.sines(y))
        if not unloading and sines.max() >= math.sin(largest_angle):
            if _land_on_angle(walk, y, phi, int(np.argmax(sines)), largest_angle):
                return Ending.REACHED
            step /= 2  # too far for Newton's method: come nearer first
            if step < SMALLEST_STEP:
                return Ending.DEAD_END
            continue
        before = (y - walk.y, phi - walk.phi)
        _accept(walk, y, phi, response, unloading)
        try:
            tangent_y, tangent_phi = _tangent(response, before)
        except LinAlgError:
            norm = math.sqrt(float(before[0] @ before[0]) + before[1] ** 2)
            tangent_y, tangent_phi = before[0] / norm, before[1] / norm
        step = min(largest_step, step * min(2.0, max(0.5, (WANTED_CORRECTIONS + 1) / (corrections + 1))))
    return Ending.DEAD_END


def _turned_tangents(walk: Walk) -> Iterator[tuple[FloatArray, float]]:
    """Tangents for sliders about to slip where the path does not simply go on: it turns back, or it localises.

    The sliders on their limits are taken as slipping, first all of them and then each alone, the others holding; each
    tangent points where that slip goes forward.
    """
    column = walk.column
    sines = column.sines(walk.y)
    cosines = np.sqrt(1 - sines * sines)
    moment = column.kr * (np.diff(walk.y[0::2]) - walk.plastic_rotation)
    limit = column.mu_r * walk.phi * cosines
    lateral = column.ks * (walk.y[1::2] - walk.plastic_lateral)
    contacts = np.flatnonzero((np.abs(moment) > limit * (1 - ALMOST)) & (column.kr > 0))
    particles = np.flatnonzero((np.abs(lateral) > column.ls * (1 - ALMOST)) & (column.ks > 0))
    choices = [(contacts, particles)]
    if len(contacts) + len(particles) > 1:
        choices += [(contacts[i : i + 1], particles[:0]) for i in range(len(contacts))]
        choices += [(contacts[:0], particles[i : i + 1]) for i in range(len(particles))]
    held_w, held_u = np.diff(walk.y[0::2]) - moment / (column.kr or 1.0), walk.y[1::2] - lateral / (column.ks or 1.0)
    for some_contacts, some_particles in choices:
        if not len(some_contacts) + len(some_particles):
            continue
        # The rest is moved a little inside its limits, the chosen a little beyond.
        factor_w, factor_u = np.full(column.N - 1, 1 - 2 * ALMOST), np.full(column.N, 1 - 2 * ALMOST)
        factor_w[some_contacts], factor_u[some_particles] = 1 + 2 * ALMOST, 1 + 2 * ALMOST
        shifted_w = held_w - (factor_w - 1) * moment / (column.kr or 1.0)
        shifted_u = held_u - (factor_u - 1) * lateral / (column.ks or 1.0)
        try:
            y, phi = _tangent(column.respond(walk.y, walk.phi, shifted_w, shifted_u), None)
        except LinAlgError:
            continue
        # slip of a moment = sign (change of relative rotation) - change of limit/kr
        by_limit = column.mu_r * (phi * cosines - walk.phi * sines / cosines * np.diff(y[1::2]) / 2)
        slip_w = np.sign(moment) * np.diff(y[0::2]) - by_limit / (column.kr or 1.0)
        slip = slip_w[some_contacts].sum() + (np.sign(lateral) * y[1::2])[some_particles].sum()
        yield (y, phi) if slip > 0 else (-y, -phi)


def _past_corner(walk: Walk) -> tuple[FloatArray, float, Response, int] | None:
    """Find the next point where the plain continuation fails, along one of `_turned_tangents`."""
    for tangent_y, tangent_phi in _turned_tangents(walk):
        step = FIRST_STEP
        while step > 1e-3 * FIRST_STEP:
            found = _correct(
                walk,
                walk.y + step * tangent_y,
                walk.phi + step * tangent_phi,
                tangent_y,
                tangent_phi,
                step,
                (walk.y, walk.phi),
            )
            if found is not None and _moves_on(walk, found, step):
                response = found[2]
                if response.moment_slips.any() or response.lateral_slips.any():
                    return found
            step /= 4
    return None


def _moves_on(walk: Walk, found: tuple[FloatArray, float, Response, int], step: float) -> bool:
    """Whether a corrected point lies near its prediction, not on another path."""
    y, phi = found[0] - walk.y, found[1] - walk.phi
    return math.sqrt(float(y @ y) + phi * phi) < 3 * step


def _land_on_angle(walk: Walk, y: FloatArray, phi: float, contact: int, angle: float) -> bool:
    """Correct a point just beyond the angle asked for to that angle; False where that fails."""
    column = walk.column
    normal = np.zeros_like(y)
    sign = math.copysign(1.0, column.sines(y)[contact])
    normal[2 * contact + 3], normal[2 * contact + 1] = sign / 2, -sign / 2
    distance = math.sin(angle) - sign * float(column.start_sines[contact])
    found = _correct(walk, y, phi, normal, 0.0, distance)
    if found is None or np.abs(column.sines(found[0])).max() > math.sin(angle) * (1 + 1e-12):
        return False
    _accept(walk, *found[:3], False)
    return True


def _land_on_zero_force(walk: Walk, tangent_y: FloatArray, tangent_phi: float) -> Ending:
    """Approach zero force in shrinking steps of the load: at zero itself moments have no strength to yield by."""
    for _ in range(40):
        target = walk.phi / 2
        ahead = (target - walk.phi) / tangent_phi if tangent_phi else 0.0
        found = _correct(walk, walk.y + ahead * tangent_y, target, np.zeros_like(walk.y), 1.0, target)
        if found is None:
            break
        before = (found[0] - walk.y, found[1] - walk.phi)
        _accept(walk, *found[:3], True)
        if walk.phi < 1e-9:
            break
        norm = math.sqrt(float(before[0] @ before[0]) + before[1] ** 2)
        tangent_y, tangent_phi = before[0] / norm, before[1] / norm
    return Ending.SEPARATED
