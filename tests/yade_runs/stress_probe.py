"""Runs in YADE: a short test, one snapshot, and YADE's own stress tensors of the same instant.

stress_probe.py ROOT PACKING-FOLDER OUTPUT-FOLDER
"""

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, sys.argv[1])

import yade

from yade_scripts import export, packing, parameters
from yade_scripts.plan import plan_of
from yade_scripts.sample import Sample

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
quick = sample.tables(None)
export.write_tables(Path(sys.argv[3]) / "quick", 0, sample.axial_strain(), *quick)
vars(yade).pop("Subdomain", None)  # as in a YADE that was built without MPI
export.write_tables(Path(sys.argv[3]) / "plain", 0, sample.axial_strain(), *sample.tables(None))
volumes = 4 / 3 * math.pi * start.radii**3  # YADE divides by a sphere's volume
np.save(Path(sys.argv[3]) / "tensors.npy", tensors[:, :2, :2] * volumes[:, None, None])
