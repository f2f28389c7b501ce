"""A run as ParaView's files: particles as points, contacts as lines between centres, a series over time of each."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.stress import particle_stress, principal
from harness.errors import InputError
from harness.reading.exports import Run
from yade_scripts.export_format import snapshot_name
from yade_scripts.run_folder import write

PARTICLES, CONTACTS = "particles", "contacts"
VTK_TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8")}
Arrays = Mapping[str, Any]


def write_vtk_run(run: Run, folder: Path, options: AnalysisOptions | None = None) -> Path:
    """Write `particles.pvd`, `contacts.pvd` and their `.vtp` files into `folder`, and return it.

    Chains are those of each snapshot by `options` (default: the analysis's defaults). The time of a collection is the
    simulated time where it grows, else the snapshot's number; the axial strain is in every file's field data.
    Raises InputError when a snapshot cannot be read.
    """
    options = options or AnalysisOptions()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the result, found a file; name another with --out")
    folder.mkdir(parents=True, exist_ok=True)
    times = []
    for number, snapshot in zip(run.snapshot_index.tolist(), run.snapshots(), strict=True):
        try:
            particles = particle_file(snapshot, options)
        except ValueError as error:
            raise InputError(f"run {run.name}: snapshot {number}: {error}") from None
        write(folder, vtp_name(PARTICLES, number), particles)
        write(folder, vtp_name(CONTACTS, number), contact_file(snapshot))
        times.append(snapshot.time)
    grows = bool(np.all(np.diff(times) > 0))
    steps = times if grows else [float(number) for number in run.snapshot_index]
    for kind in (PARTICLES, CONTACTS):
        names = [vtp_name(kind, number) for number in run.snapshot_index.tolist()]
        write(folder, f"{kind}.pvd", collection(names, steps))
    return folder


def vtp_name(kind: str, number: int) -> str:
    """Return the name of the file of snapshot `number`.

    >>> vtp_name("contacts", 12)
    'contacts/000012.vtp'
    """
    return f"{kind}/{snapshot_name(number)}.vtp"


def particle_file(snapshot: Snapshot, options: AnalysisOptions) -> bytes:
    """Return a `.vtp` of a point a particle, with all that is known of it; chain -1 is the weak network."""
    stress = principal(particle_stress(snapshot))
    chains = find_chains(snapshot, options)
    data = {
        "id": np.arange(snapshot.n_particles),
        "radius": snapshot.radius,
        "rotation": snapshot.rotation,
        "velocity": in_space(snapshot.velocity),
        "spin": snapshot.spin,
        "major_stress": stress.major,
        "minor_stress": stress.minor,
        "major_direction": in_space(stress.direction),
        "chain": chains.label,
        "highly_stressed": chains.highly_stressed.astype(np.int64),
    }
    cells = np.arange(snapshot.n_particles)
    return poly_data(snapshot, in_space(snapshot.position), "Verts", cells, 1, point_data=data)


def contact_file(snapshot: Snapshot) -> bytes:
    """Return a `.vtp` of a line a contact: from centre to centre, or to the contact point where it is with a wall."""
    first, second = snapshot.contact_ids.T
    wall = second < 0
    ends = np.where(wall[:, None], snapshot.contact_point, snapshot.position[np.where(wall, 0, second)])
    points = np.stack((snapshot.position[first], ends), axis=1).reshape(-1, 2)
    data = {
        "id1": first,
        "id2": second,
        "normal_force": snapshot.normal_force,
        "tangential_force": snapshot.tangential_force,
        "moment": snapshot.moment,
        "overlap": snapshot.overlap,
        "wall": wall.astype(np.int64),
    }
    return poly_data(snapshot, in_space(points), "Lines", np.arange(len(points)), 2, cell_data=data)


def in_space(vectors: FloatArray) -> FloatArray:
    """Return vectors (n, 2) as (n, 3), the third component zero: VTK knows no plane."""
    return np.column_stack((vectors, np.zeros(len(vectors))))


def poly_data(
    snapshot: Snapshot,
    points: FloatArray,
    kind: str,
    connectivity: Any,
    points_a_cell: int,
    *,
    point_data: Arrays | None = None,
    cell_data: Arrays | None = None,
) -> bytes:
    """Return a VTK XML PolyData file: `points` (n, 3) and cells of `kind`, numbers exact (base64 of their bytes)."""
    root = Xml.Element("VTKFile", type="PolyData", version="1.0", byte_order="LittleEndian", header_type="UInt64")
    body = Xml.SubElement(root, "PolyData")
    field = Xml.SubElement(body, "FieldData")
    for name in ("axial_strain", "time", "iteration"):
        _data_array(field, name, np.array([getattr(snapshot, name)]), field_data=True)
    n_cells = len(connectivity) // points_a_cell
    kinds = ("Verts", "Lines", "Strips", "Polys")
    counts = {f"NumberOf{name}": str(n_cells if name == kind else 0) for name in kinds}
    piece = Xml.SubElement(body, "Piece", {"NumberOfPoints": str(len(points)), **counts})
    for name, arrays in (("PointData", point_data), ("CellData", cell_data)):
        element = Xml.SubElement(piece, name)
        for label, values in (arrays or {}).items():
            _data_array(element, label, values)
    _data_array(Xml.SubElement(piece, "Points"), "points", points)
    for name in kinds:
        ends = np.arange(1, n_cells + 1) * points_a_cell if name == kind else np.zeros(0, np.int64)
        element = Xml.SubElement(piece, name)
        _data_array(element, "connectivity", np.asarray(connectivity) if name == kind else np.zeros(0, np.int64))
        _data_array(element, "offsets", ends)
    return _document(root)


def _data_array(parent: Xml.Element, name: str, values: Any, *, field_data: bool = False) -> None:
    vtk_type, dtype = VTK_TYPES[np.asarray(values).dtype.kind]
    content = np.ascontiguousarray(values, dtype=dtype)
    element = Xml.SubElement(parent, "DataArray", type=vtk_type, Name=name, format="binary")
    if field_data:
        element.set("NumberOfTuples", str(len(content)))
    elif content.ndim == 2:
        element.set("NumberOfComponents", str(content.shape[1]))
    payload = content.tobytes()
    element.text = base64.b64encode(len(payload).to_bytes(8, "little") + payload).decode("ascii")


def collection(names: Sequence[str], times: Sequence[float]) -> bytes:
    """Return a `.pvd` that lists the files of a series and the time of each."""
    root = Xml.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    body = Xml.SubElement(root, "Collection")
    for name, time in zip(names, times, strict=True):
        Xml.SubElement(body, "DataSet", timestep=repr(float(time)), part="0", file=name)
    return _document(root)


def _document(root: Xml.Element) -> bytes:
    Xml.indent(root, " ")
    text: bytes = Xml.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
