"""From chains to buckled segments: the three filters of a strain interval, and a ledger of what each leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, IntArray, freeze, sum_at
from forcechain.observe.chains import Chains
from forcechain.observe.options import ENERGY_TERMS, AnalysisOptions
from forcechain.observe.segments import buckling_angle, checked_segments
from forcechain.observe.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledger:
    """What was there and what each filter left, from a drop's start A to its end B.

    Attributes:
        particles: all particles.
        bearing_force: those with a contact whose force is not zero, at A.
        highly_stressed: those at or above the stress threshold, at A.
        in_chains: those in force chains at A: filter (a).
        lost_energy: those of them whose potential energy fell from A to B: filter (b).
        candidate_segments: three-particle segments of the chains at A.
        lost_energy_segments: those all three of whose particles lost energy.
        buckled_segments: those of them whose buckling angle grew enough: filter (c).
    """

    particles: int
    bearing_force: int
    highly_stressed: int
    in_chains: int
    lost_energy: int
    candidate_segments: int
    lost_energy_segments: int
    buckled_segments: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Filtered:
    """Which particles and segments passed which filter.

    Attributes:
        in_chain: (n_particles,) filter (a).
        lost_energy: (n_particles,) potential energy fell from A to B, in a chain or not.
        lost_energy_segment: (n_segments,) all three particles are in a chain and lost energy: filters (a) and (b).
        angle_growth: (n_segments,) buckling angle at B less that at A [rad].
        buckled: (n_segments,) passed all three.
        ledger: the counts.
    """

    in_chain: BoolArray
    lost_energy: BoolArray
    lost_energy_segment: BoolArray
    angle_growth: FloatArray
    buckled: BoolArray
    ledger: Ledger

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.in_chain, self.lost_energy, self.lost_energy_segment, self.angle_growth, self.buckled)


def potential_energy(snapshot: Snapshot, terms: Sequence[str] = ENERGY_TERMS) -> FloatArray:
    """Return the potential energy of each particle (n_particles,) [J].

    fn²/2kn ("normal"), ft²/2kt ("tangential") and m²/2kr ("rolling") of each contact: half to each of its particles,
    the whole where the other is a wall. Raises ValueError for an unknown term, and for a contact that bears a force or
    moment without a stiffness, whose energy is not defined.
    """
    if isinstance(terms, str) or any(term not in ENERGY_TERMS for term in terms):
        raise ValueError(f"terms: expected some of {', '.join(ENERGY_TERMS)}, found {terms!r}")
    energy = np.zeros(snapshot.n_contacts)
    for term, load, stiffness in (
        ("normal", snapshot.normal_force, snapshot.normal_stiffness),
        ("tangential", snapshot.tangential_force, snapshot.tangential_stiffness),
        ("rolling", snapshot.moment, snapshot.rolling_stiffness),
    ):
        if term in terms:
            soft = (stiffness == 0) & (load != 0)
            if soft.any():
                row = int(np.argmax(soft))
                raise ValueError(
                    f"contacts row {row}: expected a {term} stiffness above 0 where a load is borne, "
                    f"found load {load[row]:g} and stiffness 0"
                )
            energy += np.divide(0.5 * load**2, stiffness, out=np.zeros_like(load), where=stiffness > 0)
    first, second = snapshot.contact_ids.T
    inside = second >= 0
    total = sum_at(first, np.where(inside, 0.5, 1.0) * energy, snapshot.n_particles)
    total += sum_at(second[inside], 0.5 * energy[inside], snapshot.n_particles)
    return total


def buckled_segments(
    reference: Snapshot, end: Snapshot, chains: Chains, segments: IntArray, options: AnalysisOptions
) -> Filtered:
    """Pass the chains and segments (n_segments, 3) found in `reference` (A) through the filters up to `end` (B).

    (a) in a force chain at A; (b) the potential energy at B is below that at A, by more than `energy_tolerance` times
    that at A, for all three particles; (c) the buckling angle grew by at least `minimum_angle_growth`.
    Raises ValueError if the snapshots do not hold the same particles, or as `potential_energy` does.
    Source: Tordesillas & Muthuswamy (2009), section 1 and Fig. 1; Tordesillas, Phil. Mag. 87 (2007).
    """
    if reference.n_particles != end.n_particles:
        raise ValueError(f"end: expected {reference.n_particles} particles, found {end.n_particles}")
    segments = checked_segments(segments, reference.n_particles)
    before = potential_energy(reference, options.energy_terms)
    after = potential_energy(end, options.energy_terms)
    lost = after < before * (1 - options.energy_tolerance)
    in_chain = chains.in_chain
    lost_segment: BoolArray = np.all((lost & in_chain)[segments], axis=1)
    growth = buckling_angle(end, segments) - buckling_angle(reference, segments)
    buckled = lost_segment & (growth >= options.minimum_angle_growth)
    ledger = Ledger(
        particles=reference.n_particles,
        bearing_force=int(np.count_nonzero(chains.bearing_force)),
        highly_stressed=int(np.count_nonzero(chains.highly_stressed)),
        in_chains=int(np.count_nonzero(in_chain)),
        lost_energy=int(np.count_nonzero(lost & in_chain)),
        candidate_segments=len(segments),
        lost_energy_segments=int(np.count_nonzero(lost_segment)),
        buckled_segments=int(np.count_nonzero(buckled)),
    )
    return Filtered(
        in_chain=in_chain,
        lost_energy=lost,
        lost_energy_segment=lost_segment,
        angle_growth=growth,
        buckled=buckled,
        ledger=ledger,
    )


def total_ledger(ledgers: Sequence[Ledger]) -> Ledger:
    """Return the sum of `ledgers`, entry by entry: a particle counts once for each drop it was seen in."""
    return Ledger(**{item.name: sum(getattr(ledger, item.name) for ledger in ledgers) for item in fields(Ledger)})
