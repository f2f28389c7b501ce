"""Force chains: highly stressed particles linked along their major principal directions (Peters et al. 2005)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from forcechain.arrays import BoolArray, FloatArray, IntArray, columns, freeze
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.stress import Principal, bearing_force, particle_stress, principal

BOUNDARY_TOLERANCE = 1e-9  # a stress or a cosine this close to its limit, relatively, has reached it


@dataclass(frozen=True, slots=True, kw_only=True)
class Chains:
    """The force chains of one snapshot.

    A chain is a set of at least `minimum_chain_length` particles joined by links; it may branch and it may close.
    A link with fewer companions is kept in `links` but its particles have the label -1.

    Attributes:
        bearing_force: (n_particles,) has a contact whose force is not zero.
        highly_stressed: (n_particles,) major principal stress at or above the threshold.
        stress: principal stresses of every particle [N/m, or N m without weight].
        threshold: the stress at which a particle is highly stressed, in the same unit.
        alignment_angle: largest angle between a link and the principal directions of its two particles [rad].
        links: (n_links, 2) particles, the smaller number first.
        link_contact: (n_links,) row of the contact.
        link_cosine: (n_links, 2) absolute cosine between the link and the principal direction of each particle.
        label: (n_particles,) number of the chain, 0 to n_chains - 1, or -1.
        length: (n_chains,) number of particles.
        degree: (n_particles,) number of links.
        branch_points: (n_chains,) number of particles with three links or more.
    """

    bearing_force: BoolArray
    highly_stressed: BoolArray
    stress: Principal
    threshold: float
    alignment_angle: float
    links: IntArray
    link_contact: IntArray
    link_cosine: FloatArray
    label: IntArray
    length: IntArray
    degree: IntArray
    branch_points: IntArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.bearing_force, self.highly_stressed, self.links, self.link_contact, self.link_cosine)
        freeze(self.label, self.length, self.degree, self.branch_points)

    @property
    def n_chains(self) -> int:
        """Number of chains."""
        return len(self.length)

    @property
    def in_chain(self) -> BoolArray:
        """(n_particles,) belongs to a chain; the others are the weak network."""
        return self.label >= 0


def find_chains(snapshot: Snapshot, options: AnalysisOptions) -> Chains:
    """Find the force chains of `snapshot`.

    Highly stressed: major principal stress at or above `stress_threshold` times the mean over the particles that bear a
    force. Link: two such particles in contact under a positive normal force, the branch vector within the alignment
    angle of the major principal direction of both. Chain: connected links with at least `minimum_chain_length`
    particles. An eigenvector's sign has no meaning: only absolute cosines are used.

    Raises ValueError if the rule "180/Z" meets a coordination that gives no angle below 90 degrees.
    Source: Peters, Muthuswamy, Wibowo & Tordesillas, Phys. Rev. E 72, 041307 (2005).
    """
    stress = principal(particle_stress(snapshot, weight=options.stress_weight))
    bears = bearing_force(snapshot)
    threshold = options.stress_threshold * float(stress.major[bears].mean()) if bears.any() else np.inf
    reach = threshold - BOUNDARY_TOLERANCE * abs(threshold) if bears.any() else np.inf
    highly = bears & (stress.major >= reach)
    angle = _alignment_angle(snapshot, bears, options)
    links, rows, cosines = _links(snapshot, highly, stress.direction, angle)
    n = snapshot.n_particles
    label, length = _components(links, n, options.minimum_chain_length)
    degree = np.bincount(links.ravel(), minlength=n)
    return Chains(
        bearing_force=bears,
        highly_stressed=highly,
        stress=stress,
        threshold=float(threshold),
        alignment_angle=angle,
        links=links,
        link_contact=rows,
        link_cosine=cosines,
        label=label,
        length=length,
        degree=degree,
        branch_points=np.bincount(label[(degree > 2) & (label >= 0)], minlength=len(length)),
    )


def _components(links: IntArray, n_particles: int, fewest: int) -> tuple[IntArray, IntArray]:
    """Return the label (n_particles,) and the length (n_chains,) of the components of `fewest` particles or more."""
    linked = np.zeros(n_particles, dtype=np.bool_)
    linked[links] = True
    particle = np.flatnonzero(linked)
    node = np.cumsum(linked) - 1
    ends = node[links]
    shape = (len(particle), len(particle))
    graph = sparse.coo_array((np.ones(len(links), dtype=np.int8), (ends[:, 0], ends[:, 1])), shape=shape)
    label = np.full(n_particles, -1, dtype=np.int64)
    if not len(links):
        return label, np.zeros(0, dtype=np.int64)
    _, component = csgraph.connected_components(graph, directed=False)
    size = np.bincount(component)
    kept = size >= fewest
    label[particle] = np.where(kept, np.cumsum(kept) - 1, -1)[component]
    return label, size[kept].astype(np.int64)


def _alignment_angle(snapshot: Snapshot, bears: BoolArray, options: AnalysisOptions) -> float:
    if options.alignment_rule == "angle" or not bears.any():
        return options.alignment_angle
    loaded = snapshot.contact_ids[(snapshot.normal_force != 0) | (snapshot.tangential_force != 0)]
    coordination = np.count_nonzero(loaded >= 0) / np.count_nonzero(bears)
    if coordination <= 2:
        raise ValueError(
            f"alignment_rule 180/Z: expected a coordination above 2, found {coordination:.3g}; give an angle instead"
        )
    return float(np.pi / coordination)


def _links(
    snapshot: Snapshot, highly: BoolArray, direction: FloatArray, angle: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the linked pairs (n_links, 2), their contacts (n_links,) and absolute cosines (n_links, 2)."""
    first, second = columns(snapshot.contact_ids)
    rows = np.flatnonzero(highly[first] & (second >= 0) & (snapshot.normal_force > 0))
    rows = rows[highly[second[rows]]]
    low = np.minimum(first[rows], second[rows])
    high = np.maximum(first[rows], second[rows])
    x, y = columns(snapshot.position)
    branch_x, branch_y = x[high] - x[low], y[high] - y[low]
    length = np.hypot(branch_x, branch_y)
    touching = length == 0
    if touching.any():
        row = int(rows[int(np.argmax(touching))])
        raise ValueError(f"contacts row {row}: expected two centres, found both particles at one point")
    along_x, along_y = columns(direction)
    cosine = np.empty((len(rows), 2))
    for side, particle in enumerate((low, high)):
        cosine[:, side] = np.abs(branch_x * along_x[particle] + branch_y * along_y[particle]) / length
    reach = np.cos(angle) - BOUNDARY_TOLERANCE
    aligned = (cosine[:, 0] >= reach) & (cosine[:, 1] >= reach)
    return np.stack((low[aligned], high[aligned]), axis=1), rows[aligned], cosine[aligned]
