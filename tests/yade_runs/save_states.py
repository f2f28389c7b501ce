"""Runs in YADE: a short test that saves its state now and then, with our export of the same instants beside it.

save_states.py ROOT PACKING-FOLDER OUTPUT-FOLDER
"""

import sys
from pathlib import Path

sys.path.insert(0, sys.argv[1])

import yade

from yade_scripts import export, packing, parameters
from yade_scripts.plan import plan_of
from yade_scripts.sample import Sample

out = Path(sys.argv[3])
values = parameters.check({"particle_count": 100, "seed": 7, "final_axial_strain": 0.03})
start, _ = packing.packing_of(values, Path(sys.argv[2]))
yade.O.reset()
sample = Sample(values, start)
plan = plan_of(values, sample.masses)
yade.O.dt = plan.time_step
packing.step(1)
sample.press()
sample.load(plan.strain_rate)
rotation = None
for index, ending in enumerate(("xml", "yade.bz2", "yade")):
    for _ in range(100):
        sample.advance(20)
        sample.press()
    particles, _, _ = export.write_snapshot(out, index, sample.axial_strain(), sample.walls.numbers, rotation)
    rotation = particles["rotation"]
    (out / "states").mkdir(exist_ok=True)
    yade.O.save(str(out / "states" / f"state{index}.{ending}"), quiet=True)
middle = start.positions[((start.positions - start.positions.mean(axis=0)) ** 2).sum(axis=1).argmin()]
yade.O.bodies.append(yade.utils.box((middle[0], middle[1], 0), (1e-4, 1e-4, 1e-4), fixed=True))
packing.step(1)
yade.O.save(str(out / "with-a-stray-body.xml"), quiet=True)
print(
    *(f"{name}={sample.walls.body[wall]}" for wall, name in ((-1, "left"), (-2, "right"), (-3, "bottom"), (-4, "top")))
)
