"""Motion between two snapshots: a map of local strain, and what of the motion is not affine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.neighbours import find_neighbours
from forcechain.observe.snapshot import Snapshot

LONGEST_EDGE = 4.0  # over the mean radius: triangles with longer edges span notches of the boundary, not the material
SINGULAR = 1e-6  # neighbours on one line, by the determinant of their unit moment, give no gradient


@dataclass(frozen=True, slots=True, kw_only=True)
class StrainMap:
    """Strain of the triangles between particle centres, from one snapshot to another, compression positive.

    Attributes:
        triangles: (n_triangles, 3) particles, at the first snapshot.
        centre: (n_triangles, 2) centroids at the first snapshot [m].
        area: (n_triangles,) at the first snapshot [m^2].
        strain: (n_triangles, 2, 2) symmetric part of the displacement gradient, its sign reversed.
        shear: (n_triangles,) difference of the principal strains.
        volumetric: (n_triangles,) sum of the principal strains: below zero where the material dilates.
    """

    triangles: IntArray
    centre: FloatArray
    area: FloatArray
    strain: FloatArray
    shear: FloatArray
    volumetric: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.triangles, self.centre, self.area, self.strain, self.shear, self.volumetric)

    @property
    def mean_strain(self) -> FloatArray:
        """(2, 2) strain averaged over the area."""
        return np.average(self.strain, axis=0, weights=self.area)


def strain_map(before: Snapshot, after: Snapshot) -> StrainMap:
    """Return the local strain between two snapshots, on the Delaunay triangles of the centres in the first.

    The displacement is linear within a triangle, so averages over the area are those of the boundary's motion. Small
    strains: use snapshots that are close, or read it as the engineering strain of each triangle's edges.
    Triangles with an edge above 4 mean radii are left out. Raises ValueError for other particles or fewer than three.
    """
    _same_particles(before, after)
    if before.n_particles < 3:
        raise ValueError(f"before: expected at least 3 particles, found {before.n_particles}")
    triangles = Delaunay(before.position).simplices.astype(np.int64)
    corner = before.position[triangles]
    edges = np.stack((corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    longest = np.max(np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2), axis=1)
    determinant = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    kept = (longest <= LONGEST_EDGE * before.radius.mean()) & (np.abs(determinant) > SINGULAR * longest**2)
    triangles, corner, edges, determinant = triangles[kept], corner[kept], edges[kept], determinant[kept]
    moved = (after.position - before.position)[triangles]
    relative = np.stack((moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0]), axis=1)
    gradient = np.linalg.solve(edges, relative).transpose(0, 2, 1)
    strain = -0.5 * (gradient + gradient.transpose(0, 2, 1))
    difference = strain[:, 0, 0] - strain[:, 1, 1]
    return StrainMap(
        triangles=triangles,
        centre=corner.mean(axis=1),
        area=0.5 * np.abs(determinant),
        strain=strain,
        shear=np.hypot(difference, 2 * strain[:, 0, 1]),
        volumetric=strain[:, 0, 0] + strain[:, 1, 1],
    )


def localisation(strains: StrainMap, share: float = 0.5) -> float:
    """Return the smallest share of the area that holds `share` of the shear strain: small in a band, `share` if even.

    Raises ValueError for a share that is not between 0 and 1, and if there is no shear strain.
    """
    if not 0 < share < 1:
        raise ValueError(f"share: expected between 0 and 1, found {share:g}")
    order = np.argsort(-strains.shear)
    held = np.cumsum((strains.shear * strains.area)[order])
    if not (len(held) and held[-1] > 0):
        raise ValueError("strains: expected some shear strain, found none")
    area = np.cumsum(strains.area[order])
    return float(np.interp(share * held[-1], np.append(0, held), np.append(0, area)) / area[-1])


def nonaffine_motion(before: Snapshot, after: Snapshot) -> FloatArray:
    """Return D²min of each particle (n_particles,) [m^2]: what no affine motion of its neighbours explains.

    The mean over the contact neighbours in `before` of |r' − J r|², r and r' the branch vectors before and after and J
    the 2 x 2 gradient that makes this least. Two neighbours or fewer, or neighbours on one line, are always explained:
    such a particle has no value (not a number). Raises ValueError for snapshots of other particles.
    Source: Falk & Langer, Phys. Rev. E 57, 7192 (1998).
    """
    _same_particles(before, after)
    n = before.n_particles
    neighbours = find_neighbours(before)
    owner = np.repeat(np.arange(n), np.diff(neighbours.start))
    inside = neighbours.partner >= 0
    owner, partner = owner[inside], neighbours.partner[inside]
    old = before.position[partner] - before.position[owner]
    new = after.position[partner] - after.position[owner]
    spread, mixed = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    for row in (0, 1):
        for column in (0, 1):
            spread[:, row, column] = np.bincount(owner, old[:, row] * old[:, column], n)
            mixed[:, row, column] = np.bincount(owner, new[:, row] * old[:, column], n)
    count = np.bincount(owner, minlength=n)
    trace = spread[:, 0, 0] + spread[:, 1, 1]
    determinant = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
    solvable = (count > 2) & (determinant > SINGULAR * trace**2)
    gradient = np.zeros((n, 2, 2))
    gradient[solvable] = np.linalg.solve(spread[solvable], mixed[solvable].transpose(0, 2, 1)).transpose(0, 2, 1)
    residual = new - np.einsum("ijk,ik->ij", gradient[owner], old)
    total = np.bincount(owner, np.einsum("ij,ij->i", residual, residual), n)
    return np.where(solvable, total / np.maximum(count, 1), np.nan)


def _same_particles(before: Snapshot, after: Snapshot) -> None:
    if before.n_particles != after.n_particles:
        raise ValueError(f"after: expected {before.n_particles} particles, found {after.n_particles}")
