"""The chain and the weak particles beside it: their motion (27)-(29), the void that opens, the strain of the cluster.

Seven particles start in hexagonal close packing, the chain along x2 in the middle (paper's Fig. 3). The middle particle
buckles to the left and pushes the two left particles out; those on the right stay, and do not rotate, as do those on
the left (paper's Table 2). A packing begins hexagonal only about a straight chain, so the chain must be perfect.

Strain and curvature are averages over the hexagon of the six outer centres, displacement and rotation varying linearly
between neighbours (Bagi 1996, Mech. Mater. 22, 165-177). With them come the micropolar measures the companion work
uses for such clusters (Tordesillas, Muthuswamy and Walsh 2008, J. Eng. Mech. 134, 1095-1113):

    G_ij = (1/A) closed integral u_i n_j ds,   strain_ij = G_ij - (rotation tensor of the mean particle rotation)_ij,
    curvature_j = (1/A) closed integral w n_j ds,   nonaffine motion = motion - that of the homogeneous field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import FloatArray, freeze
from forcechain.theory.equilibrium import Number
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState

NAMES = ("bottom", "middle", "top", "left upper", "left lower", "right upper", "right lower")
BOTTOM, MIDDLE, TOP, LEFT_UPPER, LEFT_LOWER, RIGHT_UPPER, RIGHT_LOWER = range(7)
RING = (BOTTOM, RIGHT_LOWER, RIGHT_UPPER, TOP, LEFT_UPPER, LEFT_LOWER)  # anticlockwise
ROOT_3 = np.sqrt(3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cluster:
    """A cluster at each of n states; particles in the order of `NAMES`; arrays read-only.

    Attributes:
        radius: R [m].
        reference: (7, 2) centres in the unloaded packing [m].
        position: (n, 7, 2) centres [m]; x1 to the right, x2 along the chain.
        rotation: (n, 7) anticlockwise [rad].
        area: (n,) of the hexagon of the outer centres [m^2].
        void_area: (n,) the part of it that no particle covers [m^2].
        dilatation: (n,) relative change of the area since the unloaded packing.
        displacement_gradient: (n, 2, 2) G, derivative of component i by coordinate j.
        micropolar_strain: (n, 2, 2).
        curvature: (n, 2) [rad/m].
        nonaffine_displacement: (n, 7, 2) [m].
        nonaffine_rotation: (n, 7) rotation less the mean of the cluster [rad].
    """

    radius: float
    reference: FloatArray
    position: FloatArray
    rotation: FloatArray
    area: FloatArray
    void_area: FloatArray
    dilatation: FloatArray
    displacement_gradient: FloatArray
    micropolar_strain: FloatArray
    curvature: FloatArray
    nonaffine_displacement: FloatArray
    nonaffine_rotation: FloatArray

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(*(getattr(self, name) for name in self.__dataclass_fields__ if name != "radius"))


def side_contact_displacements(
    lateral_force: Number, normal_stiffness: Number, side_tangential_stiffness: Number
) -> tuple[Number, Number]:
    """Normal and tangential relative displacement [m] of a side contact, (27): sqrt(3) fs/(4 kn) and fs/(4 kt).

    Half the lateral force fs [N] acts horizontally at each of the two contacts, whose normals stay 30 degrees off.
    """
    return ROOT_3 * lateral_force / (4 * normal_stiffness), lateral_force / (4 * side_tangential_stiffness)


def side_particle_position(
    angle: Number,
    lateral_force: Number,
    radius: Number,
    normal_stiffness: Number,
    side_tangential_stiffness: Number,
) -> tuple[Number, Number]:
    """Distances x, y [m] of the left particles from the column's axis and from its middle, (29).

    x = sqrt(3) R + 2 R sin t - fs (kn + 3 kt)/(8 kn kt),   y = R + sqrt(3) fs (kn - kt)/(8 kn kt),
    which solve (28), the relative displacement of side and middle particle, for the displacements of (27).

    >>> side_particle_position(0.0, 0.0, 1.0, 1e5, 5e4)
    (np.float64(1.7320508075688772), np.float64(1.0))
    """
    kn, kt, fs = normal_stiffness, side_tangential_stiffness, lateral_force
    x = ROOT_3 * radius + 2 * radius * np.sin(angle) - fs * (kn + 3 * kt) / (8 * kn * kt)
    y = radius + ROOT_3 * fs * (kn - kt) / (8 * kn * kt)
    return x, y


def cluster(parameters: ChainParameters, state: ChainState) -> Cluster:
    """Positions, void and strain of the cluster at states of a three-particle chain.

    Args:
        parameters: one set, without imperfection.
        state: states of that chain, arrays of any shape, taken in order; every one must be an equilibrium.

    Raises ValueError for arrays of parameters, an imperfect chain, or a state without numbers.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> from forcechain.theory.three_particle import loading
    >>> cluster(TABLE_3, loading(TABLE_3, [0.1, 0.4])).dilatation.round(3)
    array([0.021, 0.139])
    """
    if parameters.shape:
        raise ValueError(f"cluster: expected one parameter set, found shape {parameters.shape}")
    if parameters.imperfection != 0:
        raise ValueError(
            "cluster: expected a perfect chain in hexagonal packing, "
            f"found imperfection {parameters.imperfection:g} rad"
        )
    t, d = np.ravel(state.angle), np.ravel(state.normal_displacement_over_R)
    if np.isnan(d).any():
        raise ValueError("cluster: expected states of equilibrium, found one without numbers; see its status")
    R = float(parameters.radius)
    reference = R * np.array([(0, -2), (0, 0), (0, 2), (-ROOT_3, 1), (-ROOT_3, -1), (ROOT_3, 1), (ROOT_3, -1)])
    position = np.tile(reference, (len(t), 1, 1))
    half = (2 - d) * R * np.cos(t)
    position[:, TOP, 1], position[:, BOTTOM, 1] = half, -half
    position[:, MIDDLE, 0] = -2 * R * np.sin(t)
    x, y = side_particle_position(
        t, np.ravel(state.lateral_force), R, parameters.normal_stiffness, parameters.side_tangential_stiffness
    )
    position[:, LEFT_UPPER] = np.stack((-x, y), axis=-1)
    position[:, LEFT_LOWER] = np.stack((-x, -y), axis=-1)
    rotation = np.zeros((len(t), 7))
    # The middle particle goes to the left: the lower contact turns its end particle anticlockwise.
    rotation[:, BOTTOM], rotation[:, TOP] = np.ravel(state.rotation), -np.ravel(state.rotation)
    return measured(R, reference, position, rotation)


def measured(radius: float, reference: FloatArray, position: FloatArray, rotation: FloatArray) -> Cluster:
    """Measure void, strain, curvature and nonaffine motion of seven particles moved from `reference`, (n, 7, 2)."""
    ring = list(RING)
    displacement = position - reference
    area0 = _polygon_area(reference[ring])
    area = _polygon_area(position[:, ring])
    normal = _edge_normals(reference[ring])  # (6, 2) outward, times the edge's length
    mean_u = (displacement[:, ring] + displacement[:, np.roll(ring, -1)]) / 2
    mean_w = (rotation[:, ring] + rotation[:, np.roll(ring, -1)]) / 2
    gradient = np.einsum("nei,ej->nij", mean_u, normal) / area0
    curvature = mean_w @ normal / area0
    spin = rotation.mean(axis=1)
    turning = spin[:, None, None] * np.array([[0.0, -1.0], [1.0, 0.0]])
    centre = reference[ring].mean(axis=0)
    affine = displacement[:, ring].mean(axis=1)[:, None, :] + np.einsum("nij,pj->npi", gradient, reference - centre)
    return Cluster(
        radius=radius,
        reference=reference.copy(),
        position=position,
        rotation=rotation,
        area=area,
        void_area=area - _covered_area(radius, position),
        dilatation=area / area0 - 1,
        displacement_gradient=gradient,
        micropolar_strain=gradient - turning,
        curvature=curvature,
        nonaffine_displacement=displacement - affine,
        nonaffine_rotation=rotation - spin[:, None],
    )


def _polygon_area(corners: FloatArray) -> FloatArray:
    """Area of anticlockwise polygons, (..., k, 2)."""
    following = np.roll(corners, -1, axis=-2)
    cross = corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]
    return np.asarray(cross.sum(axis=-1) / 2)


def _edge_normals(corners: FloatArray) -> FloatArray:
    edge = np.roll(corners, -1, axis=0) - corners
    return np.stack((edge[:, 1], -edge[:, 0]), axis=-1)


def _covered_area(radius: float, position: FloatArray) -> FloatArray:
    """Area of the hexagon that particles cover: sectors of the outer, the whole middle one, overlaps counted once.

    The sectors' angles sum to 4 pi, two whole particles. Half of the overlap of two neighbours on the ring lies inside.
    """
    covered = np.full(len(position), 3 * np.pi * radius**2)
    for here, one in enumerate(RING):
        covered -= _lens_area(radius, position, one, MIDDLE)
        covered -= _lens_area(radius, position, one, RING[here - 1]) / 2
    return covered


def _lens_area(radius: float, position: FloatArray, one: int, other: int) -> FloatArray:
    """Area shared by two discs of equal radius."""
    apart = np.linalg.norm(position[:, one] - position[:, other], axis=-1)
    ratio = np.minimum(apart / (2 * radius), 1.0)  # no overlap: no lens
    return np.asarray(2 * radius**2 * (np.arccos(ratio) - ratio * np.sqrt(1 - ratio**2)))
