"""Runs in YADE: what a sample of a few discs has in the simulation, for each of several parameter sets.

options_probe.py ROOT SETS.json
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, sys.argv[1])

import yade

from yade_scripts import checkpoint, materials, packing, parameters
from yade_scripts.plan import plan_of
from yade_scripts.sample import Sample

SIDE = 4


def probe(values):
    """Discs on a square grid, a tenth of the larger radius apart or less."""
    radii = materials.radii_of(values, np.random.default_rng(1))
    pitch = 2 * values["largest_radius"]
    places = pitch * (np.indices((SIDE, SIDE)).reshape(2, -1).T + 0.5)
    start = packing.Packing(radii, places, np.array([0, SIDE * pitch, 0, SIDE * pitch]), {})
    yade.O.reset()
    sample = Sample(values, start)
    plan = plan_of(values, sample.masses)
    sample.press()
    yade.O.dt = checkpoint.AT_REST
    yade.O.step()  # from here on YADE tells the push
    yade.O.dt = plan.time_step
    sample.load(plan.strain_rate)
    top, right = (yade.O.bodies[sample.walls.body[wall]] for wall in (-4, -2))
    states = [yade.O.bodies[number].state for number in range(sample.count)]
    return {
        "count": len([body for body in yade.O.bodies if isinstance(body.shape, yade.Sphere)]),
        "radii": sorted(yade.O.bodies[number].shape.radius for number in range(sample.count)),
        "masses": [state.mass for state in states],
        "inertia_ratios": [
            state.inertia[2] / state.mass / r**2 for state, r in zip(states, radii.tolist(), strict=True)
        ],
        "damping": yade.O.engines[0].damping,
        "engine": type(yade.O.engines[0]).__name__,
        "time_step": yade.O.dt,
        "top_velocity": top.state.vel[1],
        "push": yade.O.forces.permF(right.id)[0],
        "height": SIDE * pitch,
    }


sets = json.loads(Path(sys.argv[2]).read_text())
print("found", json.dumps([probe(parameters.check({"particle_count": SIDE**2, **given})) for given in sets]))
