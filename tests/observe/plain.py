"""The definitions once more, deliberately plain: loops and dictionaries, one particle and one contact at a time.

Written from the definitions and not from forcechain.observe, of which it uses nothing but the snapshot's arrays and the
options' values. Eigenvectors come from numpy with a random sign.
"""

from __future__ import annotations

import cmath
import math
import random
from collections import defaultdict

import numpy as np

CLOSE = 1e-9


class PlainSnapshot:
    """Contacts as records: partner, contact point, force and moment on the owner, and the contact's own numbers."""

    def __init__(self, snapshot):
        self.n = len(snapshot.radius)
        self.radius = [float(r) for r in snapshot.radius]
        self.centre = [(float(x), float(y)) for x, y in snapshot.position]
        self.rotation = [float(r) for r in snapshot.rotation]
        self.contacts = {}
        self.of = defaultdict(list)
        for c in range(len(snapshot.contact_ids)):
            i, j = (int(k) for k in snapshot.contact_ids[c])
            nx, ny = (float(v) for v in snapshot.contact_normal[c])
            fn, ft = float(snapshot.normal_force[c]), float(snapshot.tangential_force[c])
            on_j = (fn * nx + ft * -ny, fn * ny + ft * nx)
            record = {
                "point": tuple(float(v) for v in snapshot.contact_point[c]),
                "fn": fn,
                "ft": ft,
                "moment": float(snapshot.moment[c]),
                "kn": float(snapshot.normal_stiffness[c]),
                "kt": float(snapshot.tangential_stiffness[c]),
                "kr": float(snapshot.rolling_stiffness[c]),
                "friction": float(snapshot.friction[c]),
                "rolling_limit": float(snapshot.rolling_limit[c]),
            }
            pair = (min(i, j), max(i, j))
            self.contacts[pair] = record
            self.of[i].append((j, (-on_j[0], -on_j[1]), record))
            if j >= 0:
                self.of[j].append((i, on_j, record))

    def touching(self, i):
        return {partner for partner, _, _ in self.of[i]}

    @classmethod
    def once(cls, snapshot):
        """The same, made only once for one snapshot."""
        if id(snapshot) not in _MADE:
            _MADE[id(snapshot)] = (snapshot, cls(snapshot))  # the snapshot is kept, so that its id stays its own
        return _MADE[id(snapshot)][1]


_MADE = {}


def stress(s, i, weight):
    total = [[0.0, 0.0], [0.0, 0.0]]
    for _, force, record in s.of[i]:
        arm = [record["point"][k] - s.centre[i][k] for k in range(2)]
        for a in range(2):
            for b in range(2):
                total[a][b] -= force[a] * arm[b]
    area = math.pi * s.radius[i] ** 2 if weight == "area" else 1.0
    off = 0.5 * (total[0][1] + total[1][0])
    return np.array([[total[0][0], off], [off, total[1][1]]]) / area


def chains(snapshot, options, seed=0):
    """Highly stressed particles, links {pair: {particle: cosine}}, chains as sets, principal directions."""
    signs = random.Random(seed)
    s = PlainSnapshot.once(snapshot)
    major, direction = [], []
    for i in range(s.n):
        values, vectors = np.linalg.eigh(stress(s, i, options.stress_weight))
        isotropic = values[1] - values[0] <= 2e-12 * max(abs(values))
        major.append(float(values[1]))
        direction.append(np.zeros(2) if isotropic else signs.choice((-1, 1)) * vectors[:, 1])
    bearing = [i for i in range(s.n) if any(r["fn"] != 0 or r["ft"] != 0 for _, _, r in s.of[i])]
    mean = sum(major[i] for i in bearing) / len(bearing) if bearing else math.inf
    threshold = options.stress_threshold * mean
    highly = {i for i in bearing if major[i] >= threshold - CLOSE * abs(threshold)}
    angle = options.alignment_angle
    if options.alignment_rule == "180/Z":
        ends = sum(1 for i in bearing for _, _, r in s.of[i] if r["fn"] != 0 or r["ft"] != 0)
        angle = math.pi / (ends / len(bearing))
    links = {}
    for (i, j), record in s.contacts.items():
        if i < 0 or record["fn"] <= 0 or i not in highly or j not in highly:
            continue
        branch = np.subtract(s.centre[j], s.centre[i])
        cosines = {k: abs(float(branch @ direction[k])) / float(np.linalg.norm(branch)) for k in (i, j)}
        if all(cosine >= math.cos(angle) - CLOSE for cosine in cosines.values()):
            links[(i, j)] = cosines
    joined = defaultdict(set)
    for i, j in links:
        joined[i].add(j)
        joined[j].add(i)
    found, seen = [], set()
    for start in sorted(joined):
        if start in seen:
            continue
        chain, queue = set(), [start]
        while queue:
            i = queue.pop()
            if i not in chain:
                chain.add(i)
                queue.extend(joined[i] - chain)
        seen |= chain
        if len(chain) >= options.minimum_chain_length:
            found.append(chain)
    return {
        "snapshot": s, "bearing": bearing, "highly": highly, "links": links, "chains": found, "direction": direction,
        "joined": joined,
    }  # fmt: skip


def segments(found, options):
    s = found["snapshot"]
    result = set()
    at_wall = {i for i in range(s.n) if any(partner < 0 for partner in s.touching(i))}
    for chain in found["chains"]:
        for centre in chain:
            sides = {True: [], False: []}
            for end in found["joined"][centre]:
                branch = np.subtract(s.centre[end], s.centre[centre])
                pair = (min(centre, end), max(centre, end))
                key = (-found["links"][pair][centre], -s.contacts[pair]["fn"], end)
                sides[bool(branch @ found["direction"][centre] > 0)].append(key)
            if options.segment_rule == "best":
                sides = {side: sorted(keys)[:1] for side, keys in sides.items()}
            for *_, one in sides[True]:
                for *_, three in sides[False]:
                    segment = (min(one, three), centre, max(one, three))
                    if options.wall_segments == "keep" or not at_wall & set(segment):
                        result.add(segment)
    return result


def angle(s, segment):
    """The acute angle of two lines, from the argument of their quotient as complex numbers."""
    one, two, three = (complex(*s.centre[i]) for i in segment)
    angles = []
    for end in (one, three):
        turn = abs(cmath.phase((end - two) / (three - one)))
        angles.append(min(turn, math.pi - turn))
    return sum(angles) / 2


def measures(snapshot, reference, segment):
    s, start = PlainSnapshot.once(snapshot), PlainSnapshot.once(reference)
    one, two, three = segment
    line = np.subtract(s.centre[three], s.centre[one])
    length = float(np.linalg.norm(line))
    forces = []
    for end, other, inward in ((one, three, line / length), (three, one, -line / length)):
        total = 0.0
        for partner, force, record in s.of[end]:
            if partner in (two, other):
                continue
            far = s.centre[partner] if partner >= 0 else record["point"]
            if np.subtract(far, s.centre[end]) @ inward < 0:
                total += float(np.array(force) @ inward)
        forces.append(total)
    support = np.zeros(2)
    for partner, force, _ in s.of[two]:
        if partner not in (one, three):
            support += force
    offset = np.subtract(s.centre[two], s.centre[one])
    offset = offset - (offset @ line) * line / length**2
    overlap = 0.0
    for end in (one, three):
        record = s.contacts.get((min(end, two), max(end, two)))
        overlap += record["fn"] / record["kn"] if record else 0.0
    relative = [
        (s.rotation[end] - start.rotation[end]) - (s.rotation[two] - start.rotation[two]) for end in (one, three)
    ]
    return {
        "buckling_angle": angle(s, segment),
        "axial_force": sum(forces) / 2,
        "axial_displacement": math.dist(start.centre[one], start.centre[three]) - length,
        "normal_displacement": overlap / 2,
        "rotation": abs(relative[0] - relative[1]) / 2,
        "lateral_force": -float(support @ offset) / float(np.linalg.norm(offset)),
    }


def energy(s, i, terms):
    total = 0.0
    for partner, _, r in s.of[i]:
        share = 0.5 if partner >= 0 else 1.0
        for term, load, stiffness in (("normal", "fn", "kn"), ("tangential", "ft", "kt"), ("rolling", "moment", "kr")):
            if term in terms and r[load] != 0:
                total += share * r[load] ** 2 / (2 * r[stiffness])
    return total


def buckled(reference, end, found_segments, in_chains, options):
    before, after = PlainSnapshot.once(reference), PlainSnapshot.once(end)

    def lost(i):
        first = energy(before, i, options.energy_terms)
        return energy(after, i, options.energy_terms) < first * (1 - options.energy_tolerance)

    return {
        segment
        for segment in found_segments
        if all(i in in_chains and lost(i) for i in segment)
        and angle(after, segment) - angle(before, segment) >= options.minimum_angle_growth
    }


def classify(snapshots, segment, in_chains, options):
    """First increments (chain moment, weak network, chain sliding) or None, and the class."""
    instants = [PlainSnapshot.once(snapshot) for snapshot in snapshots]
    one, two, three = segment
    own = [(min(end, two), max(end, two)) for end in (one, three)]

    def plastic(s, pair, kind):
        record = s.contacts.get(pair)
        if record is None:
            return False
        load, limit = {"slide": ("ft", "friction"), "roll": ("moment", "rolling_limit")}[kind]
        most = record[limit] * record["fn"]
        return most > 0 and abs(record[load]) >= most * (1 - options.plastic_tolerance)

    def yields(k, pair, kind):
        anew = options.already_plastic == "count" or not plastic(instants[k - 1], pair, kind)
        return plastic(instants[k], pair, kind) and anew

    def weak_neighbours(s):
        return {p for i in segment for p in s.touching(i) if p >= 0 and p not in in_chains}

    moment = lateral = slide = None
    for k in range(1, len(instants)):
        s = instants[k]
        weak = weak_neighbours(instants[0] if options.neighbours_at == "start" else s)
        ring = set()
        for p in weak:
            for q in s.touching(p):
                reached = {"centre": q == two, "chain": q in segment, "between": q in segment or q in weak, "all": True}
                if reached[options.neighbour_ring]:
                    ring.add((min(p, q), max(p, q)))
        if moment is None and any(yields(k, pair, "roll") for pair in own):
            moment = k
        if lateral is None and any(yields(k, pair, kind) for pair in ring for kind in ("slide", "roll")):
            lateral = k
        if slide is None and any(yields(k, pair, "slide") for pair in own):
            slide = k
    if moment is None and lateral is None:
        number = 1
    elif moment is not None and moment == lateral:
        number = 2
    elif moment is None or (lateral is not None and lateral < moment):
        number = 3
    else:
        number = 4
    return moment, lateral, slide, number
