"""Stands in for YADE's Python: makes packings and runs in no time, or misbehaves as it is told.

It is told by `behaviour.json` in the folder it was set up in: seed -> list of what to do, one for each attempt (the
last one goes on). Every call leaves a line in `calls.txt`, every process it starts a line in `processes.txt`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from datetime import UTC, datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from run_folders import write_manifest, write_run

from yade_scripts import packing, run_folder


def note(name: str, text: str) -> None:
    with (Path(os.environ["FAKE_YADE"]) / name).open("a") as file:
        file.write(text + "\n")


def progress(folder: Path) -> None:
    told = {
        "stage": "loading",
        "pid": os.getpid(),
        "axial_strain": 0.025,
        "target_strain": 0.1,
        "steps_per_second": 2900.0,
        "seconds_left": 75.0,
        "time": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    run_folder.write_json(folder, "progress.json", told)


def hang(folder: Path) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    child = subprocess.Popen(["sleep", "1000"])
    progress(folder)
    note("processes.txt", f"{os.getpid()}\n{child.pid}")
    while True:
        time.sleep(5)
        progress(folder)


def make_run(folder: Path, values: dict[str, object], what: str) -> int:
    if what == "crash":
        print("one more step")
        raise RuntimeError("the interaction has no physics")
    if what == "silent":
        return 0
    if what == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "hang":
        hang(folder)
    if what == "no room":
        with Path("/dev/full").open("wb") as device:
            device.write(b"a snapshot")
    if what == "fail":
        write_manifest(folder, values, status="failed", failure="the servo was lost at strain 0.03")
        return 1
    write_run(folder, values)
    snapshot = folder / "snapshots" / "000001.npz"
    if what == "truncate":
        snapshot.write_bytes(snapshot.read_bytes()[:-100])
    elif what == "flip":
        content = bytearray(snapshot.read_bytes())
        content[200] ^= 1
        snapshot.write_bytes(bytes(content))
    elif what == "lie":
        snapshot.unlink()
    elif what == "empty":
        write_manifest(folder, values, products={"files": {}, "history_rows": 0, "snapshots": []})
    elif what == "other":
        write_manifest(folder, values | {"friction": 0.123})
    elif what == "broken manifest":
        (folder / "run.json").write_text('{"format": 1, "status"')
    elif what == "servo":
        manifest = json.loads((folder / "run.json").read_text())
        manifest["validity"]["servo_error_max"] = 0.031
        (folder / "run.json").write_text(json.dumps(manifest))
    elif what == "good but exit 1":
        return 1
    elif what == "good then hang":
        hang(folder)
    return 0


def main(arguments: list[str]) -> int:
    if Path(arguments[0]).name == "own_script.py":  # a script of the user's own runs through this one
        del arguments[0]
    script, given, *rest = arguments
    values = json.loads(Path(given).read_text())
    home = Path(os.environ["FAKE_YADE"])
    print("fake YADE:", " ".join(arguments))
    note("calls.txt", f"{Path(script).name} {values.get('seed')}")
    print(json.dumps({name: os.environ.get(name) for name in ("PYTHONPATH", "HOME", "OMP_NUM_THREADS", "DISPLAY")}))
    behaviour = json.loads((home / "behaviour.json").read_text()) if (home / "behaviour.json").exists() else {}
    if Path(script).name == "packing.py":
        if behaviour.get("packing") == "fail":
            print("no space between the discs")
            return 1
        with zipfile.ZipFile(Path(rest[1]) / packing.file_name(values), "w") as archive:
            archive.writestr("facts", "a packing")
        return 0
    attempts = behaviour.get(str(values["seed"]), ["good"])
    earlier = (home / "calls.txt").read_text().split("\n").count(f"{Path(script).name} {values.get('seed')}")
    return make_run(Path(rest[1]), values, attempts[min(earlier, len(attempts)) - 1])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
