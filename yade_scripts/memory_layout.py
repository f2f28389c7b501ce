"""Where YADE keeps the numbers of discs and contacts in memory: found out at run time, and only ever read.

YADE's interface hands out a contact's numbers one Python object each, which takes longer than the numbers are worth: a
tenth of a whole test. It has no call for all contacts. In memory they lie at fixed places within their objects.

Nothing is taken for granted of these places, which differ between releases: each is found by giving objects outside
the simulation numbers of their own, through YADE's interface, and looking where all of them have theirs; or, for what
the interface does not let one set, by what the simulation's contacts have. Where a place is not found, or two are,
there is no layout (None), and tables are read through the interface. `quick_tables` holds all that is read here against
the interface before it relies on it, and in every snapshot a sample of it, and the normal forces against the positions.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
import struct
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

try:
    import yade
except ImportError:
    yade = None

WORD = 8  # bytes of an address, and of a double
# A wrapper of Boost.Python: a Python object of variable size (3 words), its dictionary and weak references; then the
# address of the holder: its table of functions, the next holder, and the shared pointer.
HOLDER, POINTER = 5 * WORD, 2 * WORD
SEARCHED = 512  # bytes of an object among which an attribute is looked for
EXAMPLES = 32  # objects that have to agree on the place of what each of them has
LOWEST = 4096  # below, nothing is ever kept: an address of zero is no address
USER_SPACE = 1 << 47  # bytes that a process may address on the machines Debian has YADE for

# Attributes by class, as YADE's interface names them, and how many numbers each has.
GEOMETRY = {"normal": 3, "contactPoint": 3, "penetrationDepth": 1}
FRICTION = {"normalForce": 3, "shearForce": 3, "kn": 1, "ks": 1, "tangensOfFrictionAngle": 1}
ROLLING = {"moment_bending": 3}
STATE = {"pos": 3, "ori": 4, "vel": 3, "angVel": 3}


class Layout(NamedTuple):
    """Places in memory, bytes from the beginning of an object.

    Attributes:
        container: address of the container of all contacts, near ones that do not touch included.
        begins: in the container, where the list of its contacts begins; the next word is where that ends.
        ids, geometry, physics: in a contact. (Both ids are one word.)
        attributes: in a contact's geometry and physics and in a body's state, by their names in YADE's interface.
        states: (n,) addresses of the states of bodies 0 to n-1.
    """

    container: int
    begins: int
    ids: int
    geometry: int
    physics: int
    attributes: Mapping[str, int]
    states: np.ndarray


class Contacts(NamedTuple):
    """Contacts that bear a force: (n, 2) numbers of their bodies, (n,) addresses of their geometry and physics."""

    ids: np.ndarray
    geometry: np.ndarray
    physics: np.ndarray

    def those(self, chosen: np.ndarray) -> Contacts:
        """Return the contacts chosen by a mask (n,)."""
        return Contacts(self.ids[chosen], self.geometry[chosen], self.physics[chosen])


def learn(count: int) -> Layout | None:
    """Find the layout of the simulation as it is now, whose discs are bodies 0 to count-1; None if it is not found.

    It holds until bodies are added or the simulation is replaced. Some discs have to touch.
    """
    if ctypes.sizeof(ctypes.c_void_p) != WORD:
        return None
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY)  # where nothing is, reading fails instead of crashing
    except OSError:
        return None
    try:
        return _learn(count, lambda address, size: os.pread(memory, size, address))
    except Exception:  # whatever another release has otherwise, its interface can still be read
        return None
    finally:
        os.close(memory)


def _learn(count: int, read: Callable[[int, int], bytes]) -> Layout:
    def address_of(wrapper: Any) -> int:
        return _word(read(_word(read(id(wrapper) + HOLDER, WORD)) + POINTER, WORD))

    def blocks_of(objects: Iterable[Any]) -> list[tuple[Any, bytes]]:
        return [(one, read(address_of(one), SEARCHED)) for one in objects]

    def places_in(kind: Any, attributes: Mapping[str, int]) -> dict[str, int]:
        scratch = [kind() for _ in range(EXAMPLES)]
        for number, (one, (name, length)) in enumerate(itertools.product(scratch, attributes.items())):
            values = [number + 0.375 + 0.25 * part for part in range(length)]
            setattr(one, name, values[0] if length == 1 else type(getattr(one, name))(*values))
        return places_of(scratch, attributes)

    def places_of(objects: Iterable[Any], attributes: Mapping[str, int]) -> dict[str, int]:
        blocks = blocks_of(objects)
        return {
            name: _place_in_all(blocks, lambda one, name=name, length=length: _stored(getattr(one, name), length))
            for name, length in attributes.items()
        }

    container = address_of(yade.O.interactions)
    between = (contact for contact in yade.O.interactions if contact.id1 < count and contact.id2 < count)
    contacts = blocks_of(itertools.islice(between, EXAMPLES))
    return Layout(
        container=container,
        begins=_place_of_list(read, container, {address_of(contact) for contact, _ in contacts}),
        ids=_place_in_all(contacts, lambda contact: struct.pack("2i", contact.id1, contact.id2)),
        geometry=_place_in_all(contacts, lambda contact: struct.pack("Q", address_of(contact.geom))),
        physics=_place_in_all(contacts, lambda contact: struct.pack("Q", address_of(contact.phys))),
        attributes={
            **places_of([contact.geom for contact, _ in contacts], GEOMETRY),
            **places_in(yade.FrictPhys, FRICTION),
            **places_in(yade.CohFrictPhys, ROLLING),
            **places_in(yade.State, STATE),
        },
        states=np.array([address_of(yade.O.bodies[number].state) for number in range(count)], dtype=np.int64),
    )


def _stored(value: Any, length: int) -> bytes:
    """Bytes of a number, or of a vector's, in memory."""
    return struct.pack(f"{length}d", *((value,) if length == 1 else (value[part] for part in range(length))))


def _place_in_all(blocks: Sequence[tuple[Any, bytes]], wanted: Callable[[Any], bytes]) -> int:
    """Return the one place at which every object's block has what is wanted of that object.

    A block goes on past its object's end, where anything may be, copies of what is looked for among it.
    """
    if not blocks:
        raise LookupError("expected something to look at, found nothing")
    common = set(range(0, SEARCHED, WORD))
    for one, block in blocks:
        pattern = wanted(one)
        common = {place for place in common if block.startswith(pattern, place)}
    return _only(common)


def _place_of_list(read: Callable[[int, int], bytes], container: int, wanted: set[int]) -> int:
    """Return the place in the container of contacts where the list begins that holds the `wanted` addresses."""
    size = 2 * WORD * len(yade.O.interactions)
    words = struct.unpack(f"{SEARCHED // WORD}Q", read(container, SEARCHED))
    return _only(
        [
            number * WORD
            for number, (first, end) in enumerate(itertools.pairwise(words))
            if end - first == size and wanted <= set(np.frombuffer(read(first, size), np.uint64)[::2].tolist())
        ]
    )


def _word(block: bytes) -> int:
    return int(struct.unpack_from("Q", block)[0])


def _only(places: Collection[int]) -> int:
    if len(places) != 1:
        raise LookupError(f"expected one place, found {len(places)}")
    (place,) = places
    return place


def contacts(layout: Layout) -> Contacts | None:
    """Find all contacts; None where their list is not as long as YADE says."""
    first, end = _numbers(layout.container + layout.begins + WORD * np.arange(2), np.int64).tolist()
    if end - first != 2 * WORD * len(yade.O.interactions):
        return None
    listed = _numbers(np.arange(first, end, 2 * WORD), np.int64)
    physics = _numbers(listed + layout.physics, np.int64)
    listed, physics = listed[physics != 0], physics[physics != 0]
    geometry = _numbers(listed + layout.geometry, np.int64)
    listed, physics, geometry = (one[geometry != 0] for one in (listed, physics, geometry))
    pairs = _numbers(listed + layout.ids, np.int64).view(np.int32).reshape(-1, 2)
    return Contacts(pairs.astype(np.int64), geometry, physics)


def values(layout: Layout, objects: np.ndarray, attribute: str, part: int = 0) -> np.ndarray:
    """(n,) one number of an attribute of the objects at the addresses (n,)."""
    return _numbers(objects + (layout.attributes[attribute] + WORD * part), np.float64)


def _numbers(addresses: np.ndarray, kind: Any) -> np.ndarray:
    """Numbers of one kind at the given addresses, multiples of its size; LookupError for an address that is none."""
    memory = _all_memory(kind)
    if addresses.size and not (addresses.min() >= LOWEST and addresses.max() < USER_SPACE - WORD):
        raise LookupError("an address that is none")
    return np.asarray(memory[addresses // memory.itemsize - LOWEST // memory.itemsize])


@functools.cache
def _all_memory(kind: Any) -> np.ndarray:
    """All memory that a process may address, from `LOWEST` on, as numbers of one kind; touching none of it."""
    numbers = np.ctypeslib.as_ctypes_type(kind) * ((USER_SPACE - LOWEST) // np.dtype(kind).itemsize)
    return np.ctypeslib.as_array(numbers.from_address(LOWEST))
