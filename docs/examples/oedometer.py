"""A script of one's own: a lid presses discs in a box, with YADE's simplest contact law, and the run is exported.

yade -n -x docs/examples/oedometer.py PARAMETERS.json --folder RUN, with the project's folder on PYTHONPATH; or as the
`script` of a study, whose parameters then arrive in PARAMETERS.json.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
import yade

from yade_scripts import export, measures
from yade_scripts.recorder import Recorder

options = argparse.ArgumentParser(description=__doc__)
options.add_argument("parameters", type=Path)
options.add_argument("--folder", type=Path, default=Path())
given = options.parse_args(sys.argv[1:])
values = {"columns": 8, "radius": 1e-3, "friction": 0.4, "lid_speed": 0.05, "seed": 1}
values |= json.loads(given.parameters.read_text())

# An ordinary YADE simulation: a lattice of discs of two sizes in a box of four thick walls, a lid that comes down.
simulation = yade.O
radius, columns = values["radius"], values["columns"]
steel = simulation.materials.append(
    yade.FrictMat(young=1e8, poisson=0.3, density=2650, frictionAngle=math.atan(values["friction"]))
)
generator = np.random.default_rng(values["seed"])
for column in range(columns):
    for row in range(columns):
        size = radius * generator.choice([0.8, 1.0])
        disc = yade.utils.sphere(((2 * column + 1) * radius, (2 * row + 1) * radius, 0), size, material=steel)
        disc.state.blockedDOFs = "zXY"
        simulation.bodies.append(disc)
side, thick = 2 * radius * columns, 10 * radius


def wall(x: float, y: float) -> int:
    """Add a thick box around the point (x, y) and return its number."""
    return simulation.bodies.append(
        yade.utils.box((x, y, 0), (side / 2 + thick,) * 2 + (thick,), fixed=True, material=steel)
    )


reach = side + thick  # from the middle of the sample to the middle of a wall
middle = side / 2
left, right = wall(middle - reach, middle), wall(middle + reach, middle)
bottom, lid = wall(middle, middle - reach), wall(middle, middle + reach)
simulation.bodies[lid].state.vel = (0, -values["lid_speed"], 0)
simulation.engines = [
    # The integrator first: then positions and forces belong to the same instant whenever the loop stops.
    yade.NewtonIntegrator(damping=0.3, warnNoForceReset=False),
    yade.ForceResetter(),
    yade.InsertionSortCollider([yade.Bo1_Sphere_Aabb(), yade.Bo1_Box_Aabb()]),
    yade.InteractionLoop(
        [yade.Ig2_Sphere_Sphere_ScGeom(), yade.Ig2_Box_Sphere_ScGeom()],
        [yade.Ip2_FrictMat_FrictMat_FrictPhys()],
        [yade.Law2_ScGeom_FrictPhys_CundallStrack()],
    ),
]
simulation.dt = 0.3 * yade.utils.PWaveTimeStep()

# What is ours: which body is which wall, a snapshot and a history row now and then, and the manifest at the end.
walls = {left: -1, right: -2, bottom: -3, lid: -4}
discs = [simulation.bodies[body].state for body in export.disc_numbers()]
masses, inertias = np.array([disc.mass for disc in discs]), np.array([disc.inertia[2] for disc in discs])
recorder = Recorder(given.folder)
steps = round(0.01 * side / (values["lid_speed"] * simulation.dt))  # one per cent of the height
for sample in range(21):
    height = simulation.bodies[lid].state.pos[1] - thick - side / 2
    particles, contacts = export.tables(walls, recorder.rotation)
    faces = (0, side, 0, height)
    row = measures.history_row(
        particles, contacts, faces, (0, side, 0, side), masses, inertias, simulation.time, simulation.iter
    )
    recorder.rows.append(row)
    recorder.snapshot(row["axial_strain"], particles, contacts)
    for _ in range(steps if sample < 20 else 0):
        simulation.step()
recorder.finish(Path(sys.argv[0]), values, (), {"time_step": (simulation.dt, "s")}, steps=simulation.iter, continued=[])
