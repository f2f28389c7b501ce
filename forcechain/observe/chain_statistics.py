"""What the chains of one snapshot are like as a population: how many particles, how long, which way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.chains import Chains
from forcechain.observe.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainStatistics:
    """The population of chains of one snapshot.

    Attributes:
        chain_share: particles in chains over all particles that bear a force.
        length_count: (longest + 1,) number of chains by number of particles.
        mean_length: particles a chain; not a number without a chain.
        branching_share: chains with a branch point over all chains; not a number without a chain.
        orientation: mean direction of the links from the x axis, from 0 to pi [rad]; not a number without a link.
        alignment: from 0, links evenly in all directions, to 1, all in one.
        fabric: (2, 2) mean of n (x) n over the links, n their unit vector; zero without a link.
    """

    chain_share: float
    length_count: IntArray
    mean_length: float
    branching_share: float
    orientation: float
    alignment: float
    fabric: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.length_count, self.fabric)


def chain_statistics(snapshot: Snapshot, chains: Chains) -> ChainStatistics:
    """Return the statistics of the `chains` found in `snapshot`; links of too short chains are left out.

    Orientation and alignment are the direction and the difference of the principal values of the fabric tensor.
    Raises ValueError if the chains are those of other particles.
    """
    if len(chains.label) != snapshot.n_particles:
        raise ValueError(f"chains: expected {snapshot.n_particles} particles, found {len(chains.label)}")
    links = chains.links[chains.label[chains.links[:, 0]] >= 0]
    bearing = np.count_nonzero(chains.bearing_force)
    fabric = np.zeros((2, 2))
    orientation, alignment = np.nan, np.nan
    if len(links):
        branch = snapshot.position[links[:, 1]] - snapshot.position[links[:, 0]]
        unit = branch / np.linalg.norm(branch, axis=1)[:, None]
        fabric = unit.T @ unit / len(unit)
        difference, shear = fabric[0, 0] - fabric[1, 1], 2 * fabric[0, 1]
        alignment = float(np.hypot(difference, shear))
        orientation = float(0.5 * np.arctan2(shear, difference) % np.pi)
    return ChainStatistics(
        chain_share=float(np.count_nonzero(chains.in_chain) / bearing) if bearing else 0.0,
        length_count=np.bincount(chains.length).astype(np.int64),
        mean_length=float(chains.length.mean()) if chains.n_chains else np.nan,
        branching_share=float(np.mean(chains.branch_points > 0)) if chains.n_chains else np.nan,
        orientation=orientation,
        alignment=alignment,
        fabric=fabric,
    )
