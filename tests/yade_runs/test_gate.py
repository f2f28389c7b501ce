"""The regression gate on real runs: it passes the demo as approved, fails whatever was changed, and names it."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from yade_run_files import ROOT

from harness.cli import main
from harness.toml_text import dumps
from yade_scripts import export_format

pytestmark = pytest.mark.yade

BASELINE = ROOT / "baselines" / "demo.toml"
DEMO = ROOT / "studies" / "demo.toml"
CHANGES = {  # parameter: as changed, and what the check is to say
    "friction": (0.56, "friction 0.7 -> 0.56"),  # by 20 %
    "rolling_friction": (0.0, "rolling_friction 0.2 -> 0"),  # rolling resistance switched off
    "normal_stiffness": (1.155e5, "normal_stiffness 105000 -> 115500"),  # by 10 %
}

Check = Callable[..., tuple[int, dict[str, Any]]]


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The demo as it stands, and one packing of it for each change, all run side by side."""
    place = tmp_path_factory.mktemp("gate")
    demo = tomllib.loads(DEMO.read_text())
    files = {"demo": DEMO}
    for name, (value, _) in CHANGES.items():
        changed = demo | {"seeds": [1], "parameters": demo["parameters"] | {name: value}}
        files[name] = place / f"{name}.toml"
        files[name].write_text(dumps(changed))
    running = {
        name: subprocess.Popen(
            [sys.executable, "-m", "harness", "run", str(file), "--out", str(place / name), "--jobs", "1"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for name, file in files.items()
    }
    told = {name: process.communicate(timeout=600)[0] for name, process in running.items()}
    assert {name: process.returncode for name, process in running.items()} == dict.fromkeys(files, 0), told
    return {name: place / name for name in files}


@pytest.fixture
def check(capsys: pytest.CaptureFixture[str]) -> Check:
    """Hold a study against the demo's baseline: check(study) gives exit status and what it prints as JSON."""

    def hold(study: Path, *more: str) -> tuple[int, dict[str, Any]]:
        capsys.readouterr()
        status = main(["check", str(study), "--baseline", str(BASELINE), "--json", *more])
        told = capsys.readouterr()
        return status, json.loads(told.out) if told.out else {"error": told.err}

    return hold


@pytest.fixture
def copied(studies: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    """Copy a study, tables linked: what is to be changed in the copy is to be replaced, not rewritten."""
    return lambda name: Path(shutil.copytree(studies[name], tmp_path / name, copy_function=os.link))


def replace_file(path: Path, content: bytes) -> None:
    path.unlink()
    path.write_bytes(content)


def line_of(told: dict[str, Any], quantity: str) -> dict[str, Any]:
    (line,) = [line for line in told["lines"] if line["quantity"] == quantity]
    return line


def first_run(study: Path) -> Path:
    return sorted((study / "runs").iterdir())[0]


def vouch(run: Path, name: str) -> None:
    """Let the manifest vouch for a file as it is now, as one would who forges it."""
    manifest = json.loads((run / export_format.MANIFEST).read_text())
    content = (run / name).read_bytes()
    manifest["products"]["files"][name] = {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    replace_file(run / export_format.MANIFEST, json.dumps(manifest).encode())


def perturbed_snapshot(run: Path, column: str) -> str:
    """Multiply one column of the run's first snapshot by 1.05; return the file's name."""
    name = f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(0)}.npz"
    with np.load(run / name) as stored:
        arrays = {key: stored[key] for key in stored.files}
    (run / name).unlink()
    np.savez_compressed(run / name, **(arrays | {column: 1.05 * arrays[column]}))
    return name


def perturbed_history(run: Path, column: str) -> str:
    path = run / export_format.HISTORY
    table = pd.read_csv(path)
    replace_file(path, table.assign(**{column: 1.05 * table[column]}).to_csv(index=False).encode())
    return export_format.HISTORY


def test_the_demo_passes_against_its_approved_baseline(studies: dict[str, Path], check: Check, tmp_path: Path) -> None:
    junit = tmp_path / "check.xml"
    status, told = check(studies["demo"], "--junit", str(junit))
    assert [line for line in told["lines"] if line["outcome"] != "pass"] == []
    assert status == 0
    assert len(told["lines"]) > 25
    suite = ElementTree.fromstring(junit.read_bytes()).find("testsuite")
    assert suite is not None
    assert suite.get("failures") == "0"


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_parameter_fails_and_is_named(studies: dict[str, Path], check: Check, name: str) -> None:
    words = CHANGES[name][1]
    status, told = check(studies[name])
    assert status == 1
    assert words in told["differs"]
    assert line_of(told, "parameters")["outcome"] == "NOT COMPARABLE"
    assert words in line_of(told, "parameters")["why"]
    assert words in line_of(told, "contacts of the tables")["why"]
    peak = line_of(told, "peak stress ratio")
    assert peak["outcome"] == "NOT COMPARABLE"
    assert words in peak["why"]
    if name == "rolling_friction":  # and the numbers themselves could not have passed
        assert peak["drift"] > 3


@pytest.mark.parametrize("name", CHANGES)
def test_a_parameter_changed_behind_the_manifest_is_told_by_the_tables(
    copied: Callable[[str], Path], check: Check, name: str
) -> None:
    study = copied(name)
    path = first_run(study) / export_format.MANIFEST
    manifest = json.loads(path.read_text())
    approved = tomllib.loads(BASELINE.read_text())["cases"][0]["parameters"]
    manifest["parameters"][name]["value"] = approved[name]
    replace_file(path, json.dumps(manifest).encode())
    status, told = check(study)
    assert status == 1
    assert line_of(told, "parameters")["outcome"] == "pass"
    assert CHANGES[name][1] in line_of(told, "contacts of the tables")["why"]


def test_another_option_of_the_analysis_fails_and_is_named(copied: Callable[[str], Path], check: Check) -> None:
    study = copied("demo")
    path = study / "study.toml"
    replace_file(path, path.read_bytes() + b"\n[analysis]\nalignment_angle_deg = 40.0\n")
    status, told = check(study)
    assert status == 1
    assert "alignment_angle_deg 45 -> 40" in line_of(told, "options of the analysis")["why"]
    assert "alignment_angle_deg 45 -> 40" in line_of(told, "initial buckling angle, mean")["why"]


@pytest.mark.parametrize(
    ("perturb", "column", "quantity"),
    [
        (perturbed_history, "stress_ratio", "tables agree: history"),
        (perturbed_snapshot, "contact_fn", "tables agree: normal law"),
        (perturbed_snapshot, "particle_x", "tables agree: geometry"),
    ],
)
def test_a_table_perturbed_by_5_percent_fails_and_is_named(
    copied: Callable[[str], Path], check: Check, perturb: Callable[[Path, str], str], column: str, quantity: str
) -> None:
    study = copied("friction")  # one run
    run = first_run(study)
    name = perturb(run, column)
    status, told = check(study)
    assert status == 2  # not what the run wrote
    assert run.name in told["error"]
    assert name in told["error"] or Path(name).name in told["error"]
    vouch(run, name)  # the checksum forged: the tables contradict themselves
    status, told = check(study)
    assert status == 1
    assert line_of(told, quantity)["outcome"] == "DRIFTED"
    assert "contradict" in line_of(told, quantity)["why"]


def test_a_table_of_the_analysis_perturbed_by_5_percent_fails_and_is_named(
    copied: Callable[[str], Path], check: Check, tmp_path: Path
) -> None:
    study, baseline = copied("demo"), tmp_path / "own.toml"
    assert main(["approve", str(study), "--baseline", str(baseline), "--reason", "as it was written"]) == 0
    path = study / "analysis" / "segments.csv"
    segments = pd.read_csv(path)
    replace_file(path, segments.assign(rotation_deg=1.05 * segments["rotation_deg"]).to_csv(index=False).encode())
    status, told = check(study, "--baseline", str(baseline))
    assert status == 1
    drifted = [line["quantity"] for line in told["lines"] if line["outcome"] == "DRIFTED"]
    assert "rotation at the end of the drop" in drifted
    assert not {"peak stress ratio", "initial buckling angle, mean"} & set(drifted)
