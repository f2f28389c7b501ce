"""Which contacts are plastic, and the order in which chain moments and lateral support yield: the four classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcechain.arrays import BoolArray, IntArray, freeze
from forcechain.observe.chains import Chains
from forcechain.observe.neighbours import Neighbours, find_neighbours
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import checked_segments
from forcechain.observe.snapshot import LOWEST_WALL, Snapshot

NEVER = -1  # the increment of what does not happen within the window
CLASS_NAMES = {1: "both elastic", 2: "together", 3: "lateral first", 4: "moment first"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Yielding:
    """When the contacts in and around three-particle segments yield, by increments after the start.

    Attributes:
        chain_moment: (n_segments,) first increment at which the moment of the contact 1-2 or 2-3 is plastic, or -1.
        weak_network: (n_segments,) first increment at which a contact of the weak neighbours is plastic by sliding or
            rolling, or -1.
        buckling_class: (n_segments,) 1 neither, 2 together, 3 the weak network first or alone, 4 the chain's moment
            first or alone.
        chain_sliding: (n_segments,) first increment at which the contact 1-2 or 2-3 slides, or -1.
    """

    chain_moment: IntArray
    weak_network: IntArray
    buckling_class: IntArray
    chain_sliding: IntArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.chain_moment, self.weak_network, self.buckling_class, self.chain_sliding)

    @property
    def slides_in_chain(self) -> BoolArray:
        """(n_segments,) a contact of the chain slides at some increment."""
        slides: BoolArray = self.chain_sliding != NEVER
        return slides

    @property
    def slides_first(self) -> BoolArray:
        """(n_segments,) a contact of the chain slides before a moment of the chain is plastic, or instead of it.

        Such a segment buckles by sliding inside the chain; one that slides later has buckled by rolling before.
        """
        before: BoolArray = (self.chain_moment == NEVER) | (self.chain_sliding < self.chain_moment)
        return self.slides_in_chain & before


def sliding(snapshot: Snapshot, tolerance: float) -> BoolArray:
    """Return which contacts slide (n_contacts,): abs(ft) at μ fn, to the relative `tolerance`.

    A contact whose limit is zero (a frictionless wall) bears nothing that could yield and does not count.
    """
    limit = snapshot.friction * snapshot.normal_force
    return (limit > 0) & (np.abs(snapshot.tangential_force) >= limit * (1 - tolerance))


def rolling(snapshot: Snapshot, tolerance: float) -> BoolArray:
    """Return which contacts roll (n_contacts,): abs(moment) at its limit times fn, to the relative `tolerance`.

    As for sliding, a contact without a limit does not count.
    """
    limit = snapshot.rolling_limit * snapshot.normal_force
    return (limit > 0) & (np.abs(snapshot.moment) >= limit * (1 - tolerance))


def classify(snapshots: Sequence[Snapshot], segments: IntArray, chains: Chains, options: AnalysisOptions) -> Yielding:
    """Find when the moments in `segments` (n_segments, 3) and their lateral support first yield, and the class.

    `snapshots` run from the start A, of which `chains` are the force chains, to the end of the window, one for each
    increment: the increments are the resolution of "at the same time". The weak neighbours of a segment are the
    particles outside all chains that touch one of its three particles (`neighbours_at` the increment in question, or at
    A). Their contacts are those with the centre (`neighbour_ring` "centre"), with any of the three ("chain"), also
    those between two of them ("between"), or all they have ("all"), walls included.

    With `already_plastic` "ignore" a contact yields at the increment at which it is plastic and was not, or did not
    exist, one increment before; with "count" it yields wherever it is plastic. Sliding and rolling are told apart in
    this: a contact that slides and then also rolls yields anew.

    Raises ValueError for fewer than two snapshots, or snapshots of other particles.
    Source: Tordesillas & Muthuswamy (2009), section 2.2 and Table 1.
    """
    if len(snapshots) < 2:
        raise ValueError(f"snapshots: expected the start and at least one increment, found {len(snapshots)}")
    n = len(chains.label)
    segments = checked_segments(segments, n)
    weak = ~chains.in_chain
    chain_moment = np.full(len(segments), NEVER)
    weak_network = np.full(len(segments), NEVER)
    chain_sliding = np.full(len(segments), NEVER)
    touching: IntArray | None = None
    before = _State.of(snapshots[0], options)
    if options.neighbours_at == "start":
        touching = _weak_neighbours(find_neighbours(snapshots[0]), segments, weak)
    for increment in range(1, len(snapshots)):
        snapshot = snapshots[increment]
        if snapshot.n_particles != n:
            raise ValueError(f"snapshot {increment}: expected {n} particles, found {snapshot.n_particles}")
        now = _State.of(snapshot, options)
        slides, rolls = now.yields_since(before) if options.already_plastic == "ignore" else (now.slides, now.rolls)
        neighbours = find_neighbours(snapshot)
        row, contact = _chain_contacts(neighbours, segments)
        slide = _any_of_row(row, slides[contact], len(segments))
        chain_sliding[slide & (chain_sliding == NEVER)] = increment
        moment = _any_of_row(row, rolls[contact], len(segments))
        chain_moment[moment & (chain_moment == NEVER)] = increment
        pending = np.flatnonzero(weak_network == NEVER)
        yielded = _support_yields(neighbours, segments, weak, slides | rolls, pending, touching, options)
        weak_network[pending[yielded]] = increment
        before = now
    return Yielding(
        chain_moment=chain_moment,
        weak_network=weak_network,
        buckling_class=_class_of(chain_moment, weak_network),
        chain_sliding=chain_sliding,
    )


@dataclass(frozen=True, slots=True)
class _State:
    """Which contacts are plastic at one instant, with a key that names each contact at every instant."""

    key: IntArray
    slides: BoolArray
    rolls: BoolArray

    @classmethod
    def of(cls, snapshot: Snapshot, options: AnalysisOptions) -> _State:
        low = snapshot.contact_ids.min(axis=1) - LOWEST_WALL
        high = snapshot.contact_ids.max(axis=1)
        return cls(
            high * (snapshot.n_particles - LOWEST_WALL) + low,
            sliding(snapshot, options.plastic_tolerance),
            rolling(snapshot, options.plastic_tolerance),
        )

    def yields_since(self, before: _State) -> tuple[BoolArray, BoolArray]:
        """Return which contacts slide, and which roll, that did not before."""
        slides, rolls = self.slides.copy(), self.rolls.copy()
        slides[slides] = ~np.isin(self.key[slides], before.key[before.slides])
        rolls[rolls] = ~np.isin(self.key[rolls], before.key[before.rolls])
        return slides, rolls


def _any_of_row(row: IntArray, flag: BoolArray, n_rows: int) -> BoolArray:
    found = np.zeros(n_rows, dtype=np.bool_)
    found[row[flag]] = True
    return found


def _chain_contacts(neighbours: Neighbours, segments: IntArray) -> tuple[IntArray, IntArray]:
    """Return the contacts 1-2 and 2-3 that exist: row of the segment and of the contact."""
    row, end = neighbours.ends_of(segments[:, 1])
    partner = neighbours.partner[end]
    own = (partner == segments[row, 0]) | (partner == segments[row, 2])
    return row[own], neighbours.contact[end[own]]


def _weak_neighbours(neighbours: Neighbours, segments: IntArray, weak: BoolArray) -> IntArray:
    """Return the pairs of segment and weak neighbour as sorted keys: segment times the number of particles, plus it."""
    member, end = neighbours.ends_of(segments.ravel())
    partner = neighbours.partner[end]
    is_weak = (partner >= 0) & weak[np.maximum(partner, 0)]
    return np.unique((member[is_weak] // 3) * len(weak) + partner[is_weak])


def _support_yields(
    neighbours: Neighbours,
    segments: IntArray,
    weak: BoolArray,
    yields: BoolArray,
    pending: IntArray,
    touching: IntArray | None,
    options: AnalysisOptions,
) -> BoolArray:
    """Return for which of the `pending` segments a contact of the weak neighbours yields (n_pending,)."""
    n = len(weak)
    segments = segments[pending]
    if touching is None:
        pairs = _weak_neighbours(neighbours, segments, weak)
    else:
        renumbered = np.full(int(pending.max(initial=-1)) + 1, NEVER)
        renumbered[pending] = np.arange(len(pending))
        of_pending = np.isin(touching // n, pending)
        pairs = renumbered[touching[of_pending] // n] * n + touching[of_pending] % n
    which, neighbour = pairs // n, pairs % n
    row, end = neighbours.ends_of(neighbour)
    reached = yields[neighbours.contact[end]]
    row, partner = row[reached], neighbours.partner[end[reached]]
    segment = which[row]
    if options.neighbour_ring != "all":
        members = segments[segment, 1:2] if options.neighbour_ring == "centre" else segments[segment]
        counts = (members == partner[:, None]).any(axis=1)
        if options.neighbour_ring == "between":
            counts |= (partner >= 0) & np.isin(segment * n + partner, pairs)
        segment = segment[counts]
    return _any_of_row(segment, np.ones(len(segment), dtype=np.bool_), len(segments))


def _class_of(chain_moment: IntArray, weak_network: IntArray) -> IntArray:
    late = np.iinfo(np.int64).max
    moment = np.where(chain_moment == NEVER, late, chain_moment)
    lateral = np.where(weak_network == NEVER, late, weak_network)
    found = np.where(lateral < moment, 3, np.where(moment < lateral, 4, 2))
    found[(moment == late) & (lateral == late)] = 1
    return found
