"""Checkpoints: a long run keeps its state now and then, and goes on from there after it was killed.

YADE continues from a saved state deterministically, but not with the same bits as without the break, and only in the
same version: a run says in its manifest where it was continued. A checkpoint is a folder that appears by rename.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from yade_scripts import run_folder

try:
    import yade
except ImportError:
    yade = None

PREFIX = "checkpoint-"
SCENE, STATE = "scene.yade.bin", "state.json"
AT_REST = 1e-30  # s: a step this short moves nothing


def saved_in(folder: Path) -> list[Path]:
    """Checkpoints in a run's folder, the newest first."""
    return sorted(folder.glob(f"{PREFIX}[0-9]*"), reverse=True)


def identity_of(values: Mapping[str, Any]) -> dict[str, Any]:
    """What has to be the same for a run to go on from a checkpoint."""
    return {
        "parameters": dict(values),
        "script_hash": run_folder.script_hash(),
        "yade_version": yade.config.version,
    }


def save(folder: Path, step: int, identity: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Keep the simulation and `state` (plain numbers, texts, lists) as they are after `step` steps."""
    target = folder / f"{PREFIX}{step:012d}"
    temporary = folder / f".{target.name}.{os.getpid()}"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    try:
        yade.O.save(str(temporary / SCENE), quiet=True)
        run_folder.write_json(temporary, STATE, {"step": step, "identity": identity, **state}, durable=True)
        run_folder.settle(folder)  # the scene, and the run's files so far: the older checkpoint goes now
        shutil.rmtree(target, ignore_errors=True)
        temporary.rename(target)
        run_folder.settle(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for older in saved_in(folder)[1:]:
        shutil.rmtree(older)


def load(folder: Path, identity: Mapping[str, Any]) -> dict[str, Any] | None:
    """Bring back the newest checkpoint of the same run; return its state, or None when there is none.

    Afterwards the scene's forces are there as well, though the simulation has not moved.
    """
    for path in saved_in(folder):
        try:
            state = json.loads((path / STATE).read_bytes())
        except (OSError, ValueError):
            continue
        if not isinstance(state, dict) or state.get("identity") != json.loads(json.dumps(identity)):
            continue
        yade.O.load(str(path / SCENE), quiet=True)
        for body in range(len(yade.O.bodies)):
            yade.O.forces.setPermF(body, (0, 0, 0))
        time_step = yade.O.dt
        yade.O.dt = AT_REST  # forces are not saved: find them again where everything is
        yade.O.step()
        yade.O.dt = time_step
        return state
    return None


def clear(folder: Path) -> None:
    """Remove all checkpoints of a run."""
    for path in [*saved_in(folder), *folder.glob(f".{PREFIX}*")]:
        shutil.rmtree(path, ignore_errors=True)
