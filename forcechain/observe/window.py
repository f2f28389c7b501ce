"""One drop of the stress ratio, observed: its chains, its buckled segments, and what becomes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.chains import Chains, find_chains
from forcechain.observe.filters import Filtered, Ledger, buckled_segments
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.plasticity import Yielding, classify
from forcechain.observe.segments import Measures, find_segments, measure
from forcechain.observe.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class DropObservation:
    """What one drop shows, from its start A to its end B.

    Attributes:
        options: the choices it was made with.
        axial_strain: (n_increments + 1,) of the snapshots, A first.
        chains: force chains at A.
        segments: (n_segments, 3) three-particle segments of the chains at A.
        filtered: what each filter let pass.
        buckled: (n_buckled, 3) the segments that buckled.
        measures: of the buckled segments, arrays (n_increments + 1, n_buckled).
        yielding: of the buckled segments: when contacts yield, and the class.
    """

    options: AnalysisOptions
    axial_strain: FloatArray
    chains: Chains
    segments: IntArray
    filtered: Filtered
    buckled: IntArray
    measures: Measures
    yielding: Yielding

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.axial_strain, self.segments, self.buckled)

    @property
    def ledger(self) -> Ledger:
        """What was there and what each filter left."""
        return self.filtered.ledger

    @property
    def n_buckled(self) -> int:
        """Number of buckled segments."""
        return len(self.buckled)


def observe_drop(snapshots: Sequence[Snapshot], options: AnalysisOptions) -> DropObservation:
    """Find the chains at the first of `snapshots`, the segments that buckle up to the last, and measure them at each.

    The sequence may load its snapshots as they are asked for: it is gone through from A to B no more than three times
    and one or two snapshots are held at once. Raises ValueError for fewer than two snapshots, for other particles, or
    for a strain that does not grow.
    """
    if len(snapshots) < 2:
        raise ValueError(f"snapshots: expected the start and the end of a drop at least, found {len(snapshots)}")
    start = snapshots[0]
    chains = find_chains(start, options)
    segments = find_segments(start, chains, options)
    filtered = buckled_segments(start, snapshots[-1], chains, segments, options)
    buckled = segments[filtered.buckled]
    strain: list[float] = []
    found: list[Measures] = []
    for index, snapshot in enumerate(snapshots):
        if strain and snapshot.axial_strain <= strain[-1]:
            raise ValueError(
                f"snapshot {index}: expected an axial strain above {strain[-1]:g}, found {snapshot.axial_strain:g}"
            )
        strain.append(snapshot.axial_strain)
        found.append(measure(snapshot, start, buckled, lateral_force=options.lateral_force))
    measures = Measures(
        **{item.name: np.stack([getattr(measured, item.name) for measured in found]) for item in fields(Measures)}
    )
    return DropObservation(
        options=options,
        axial_strain=np.array(strain),
        chains=chains,
        segments=segments,
        filtered=filtered,
        buckled=buckled,
        measures=measures,
        yielding=classify(snapshots, buckled, chains, options),
    )
