"""Run inside YADE: how long its own particle stress takes. Arguments: an npz with radius and position, repetitions."""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import yade
import yade.utils

discs = np.load(sys.argv[1], allow_pickle=False)
material = yade.FrictMat(young=1e5, poisson=0.5)
yade.O.bodies.append(
    [
        yade.utils.sphere((float(x), float(y), 0.0), 1.05 * float(radius), material=material)
        for (x, y), radius in zip(discs["position"], discs["radius"], strict=True)
    ]
)
yade.O.engines = [
    yade.ForceResetter(),
    yade.InsertionSortCollider([yade.Bo1_Sphere_Aabb()], verletDist=0),
    yade.InteractionLoop(
        [yade.Ig2_Sphere_Sphere_ScGeom()],
        [yade.Ip2_FrictMat_FrictMat_FrictPhys()],
        [yade.Law2_ScGeom_FrictPhys_CundallStrack()],
    ),
]
yade.O.dt = 1e-9
yade.O.step()
repetitions = int(sys.argv[2])
begin = time.perf_counter()
for _ in range(repetitions):
    yade.utils.bodyStressTensors()
seconds = (time.perf_counter() - begin) / repetitions
print(json.dumps({"seconds": seconds, "contacts": yade.O.interactions.countReal()}))
