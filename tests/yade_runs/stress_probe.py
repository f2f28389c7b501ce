"""Runs in YADE: a short test, one snapshot read in every way, and YADE's own stress tensors of the same instant.

stress_probe.py ROOT PACKING-FOLDER OUTPUT-FOLDER
"""

import json
import math
import os
import sys
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.insert(0, sys.argv[1])

import yade

from yade_scripts import export, memory_layout, packing, parameters, quick_tables
from yade_scripts.plan import plan_of
from yade_scripts.sample import Sample

values_of = memory_layout.values
values = parameters.check({"particle_count": 200, "seed": 7, "final_axial_strain": 0.03, "wall_friction": 0.3})
start, _ = packing.packing_of(values, Path(sys.argv[2]))
yade.O.reset()
sample = Sample(values, start)
plan = plan_of(values, sample.masses)
yade.O.dt = plan.time_step
packing.step(1)
sample.press()
sample.load(plan.strain_rate)
for _ in range(250):
    sample.advance(20)
    sample.press()
export.write_snapshot(sys.argv[3], 0, sample.axial_strain(), sample.walls.numbers)
tensors = np.array([[list(row) for row in tensor] for tensor in yade.utils.bodyStressTensors()[: sample.count]])
ways = {}


def write(name, reader):
    export.write_tables(Path(sys.argv[3]) / name, 0, sample.axial_strain(), *reader.tables(None))
    ways[name] = reader.way


def reader_of_its_own():
    return quick_tables.QuickTables(sample.radii, sample.walls.numbers, sample.rules, None)


def misled(**wrong):
    reader = reader_of_its_own()
    reader.tables(None)
    reader._layout = reader._layout._replace(**wrong)
    return reader


write("quick", sample.reader)
layout = memory_layout.learn(sample.count)
write("other forces", misled(attributes={**layout.attributes, "normalForce": layout.attributes["shearForce"]}))
write("no list", misled(begins=layout.begins + 8))
place = layout.attributes
for name, other in (
    ("shearForce", "normalForce"),
    ("moment_bending", "shearForce"),
    ("angVel", "vel"),
    ("kn", "ks"),
    ("penetrationDepth", "normal"),
):
    write(f"{name} from {other}", misled(attributes={**place, name: place[other]}))
write("nowhere", misled(physics=memory_layout.USER_SPACE))
with mock.patch.object(memory_layout, "values", lambda *given: values_of(*given) * (1 + 1e-15)):
    write("rounded", reader_of_its_own())
with mock.patch.object(memory_layout, "SEARCHED", 64):
    write("not found", reader_of_its_own())
with mock.patch.dict(os.environ, {quick_tables.VARIABLE: quick_tables.INTERFACE}):
    write("asked for", reader_of_its_own())
(Path(sys.argv[3]) / "ways.json").write_text(json.dumps(ways))
volumes = 4 / 3 * math.pi * start.radii**3  # YADE divides by a sphere's volume
np.save(Path(sys.argv[3]) / "tensors.npy", tensors[:, :2, :2] * volumes[:, None, None])
