"""A study of the punch: its parameters, its verdicts, and what the report says of it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from buckling_study import RADIUS, arrays, write_buckling_study
from matplotlib.patches import Rectangle

from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.comparing.comparison import compare
from harness.comparing.verdicts import Verdict
from harness.errors import EXIT_GOOD, InputError
from harness.figures.packing import plot_discs
from harness.reading.consistency import run_consistency
from harness.reading.exports import read_run, read_snapshot
from harness.reading.tested import test_of as name_of_test
from harness.reading.validity import faults, judge
from harness.study import RunSettings, read_study
from yade_scripts import export_format, packing, parameters

ROOT = Path(__file__).parents[2]


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(f"script = 'punch'\n{text}")
    return path


@pytest.fixture(scope="module")
def punched(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """The study made by hand, said to be of punch tests."""
    directory = write_buckling_study(tmp_path_factory.mktemp("study") / "punched")
    for path in directory.glob("runs/*/run.json"):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"script": "punch.py"}))
    return analyse(directory, jobs=1)


def test_a_punch_has_its_own_parameters_and_defaults(tmp_path: Path) -> None:
    (run,) = read_study(write(tmp_path, "")).planned_runs()
    assert run.parameters["particle_count"] == 38849
    assert run.parameters["punch_friction"] == 0.7
    assert set(run.parameters) == {parameter.name for parameter in parameters.PUNCH}
    assert set(parameters.check({})) == set(run.parameters) - {parameter.name for parameter in parameters.BED}
    for parameter in parameters.PUNCH:
        assert parameter.check(parameter.default) == parameter.default
        assert parameter.meaning


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("punch_width_over_bed_width = 0", "punch_width_over_bed_width: expected a number above 0 up to 0.8"),
        ("punch_width_over_bed_width = 0.9", "punch_width_over_bed_width: expected a number above 0 up to 0.8"),
        ("particle_count = 1000", "expected at least 0.067, a punch 3 discs wide on this bed of about 45, found 0.05"),
        ("bed_width_over_height = -2", "bed_width_over_height: expected a number from 0.1 up to 20"),
        ("punch_friction = 'rough'", "punch_friction: expected a number from 0 up to 10"),
        ("punch_frction = 0.1", "unknown parameter 'punch_frction'; did you mean 'punch_friction'?"),
        ("final_axial_strain = 0", "final_axial_strain: expected a number above 0 up to 0.9"),
        ("confining_stress = 0", "confining_stress: expected a number above 0"),
    ],
)
def test_a_bad_parameter_ends_in_one_line(tmp_path: Path, text: str, expected: str) -> None:
    narrow = "" if "width_over_bed" in text else "punch_width_over_bed_width = 0.05\n"
    with pytest.raises(InputError) as caught:
        read_study(write(tmp_path, f"[parameters]\n{narrow}{text}\n"))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_punch_s_parameters_are_not_the_biaxial_test_s(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text("[parameters]\npunch_friction = 0.1\n")
    with pytest.raises(InputError, match="unknown parameter 'punch_friction'"):
        read_study(path)


def test_one_bed_serves_every_friction_and_punch(tmp_path: Path) -> None:
    def bed(text: str) -> str:
        (run,) = read_study(write(tmp_path, f"[parameters]\nparticle_count = 1000\n{text}")).planned_runs()
        return packing.file_name(run.parameters)

    same = bed("")
    assert bed("friction = 0.3\npunch_width_over_bed_width = 0.4\npunch_friction = 0.0") == same
    assert bed("bed_width_over_height = 3.0") != same
    assert bed("confining_stress = 50.0") != same
    square = parameters.check({"particle_count": 1000, "confining_stress": 40.0})
    assert packing.file_name(square) != same


def test_the_studies_that_come_along_can_be_read() -> None:
    for name, count in (("punch", 3000), ("punch-paper", 38849)):
        study = read_study(ROOT / "studies" / f"{name}.toml")
        assert {run.parameters["particle_count"] for run in study.planned_runs()} == {count}


def test_a_punch_s_run_has_to_tell_every_figure() -> None:
    manifest = {
        "script": "punch.py",
        "preparation": {"solid_fraction": 0.84},
        "validity": {
            "servo_error_max": 0.0,
            "unbalanced_force_max": 0.01,
            "overlap_max": 0.1,
            "inertial_number": 1e-3,
            "kinetic_over_elastic_max": 0.02,
            "escaped_discs": 0,
            "settled": True,
        },
    }
    assert faults(judge(manifest, RunSettings())) is None
    escaped = {**manifest, "validity": manifest["validity"] | {"escaped_discs": 1}}  # type: ignore[operator]
    assert "number of discs outside the walls (escaped_discs) is 1" in str(faults(judge(escaped, RunSettings())))
    silent = {**manifest, "validity": {}}
    assert "(overlap_max) is not told" in str(faults(judge(silent, RunSettings())))


def test_the_test_is_known_by_its_script() -> None:
    assert name_of_test({"script": "punch.py"}) == "punch"
    assert name_of_test({"script": "mine.py"}) == name_of_test({}) == name_of_test(None) == "biaxial"


def test_nothing_printed_of_the_biaxial_test_is_held_against_a_punch(punched: Analysis) -> None:
    (case,) = punched.cases
    assert punched.test(case) == "punch"
    rows, curves = compare(punched, {})
    assert case in curves
    assert {row.verdict for row in rows} == {Verdict.NOT_JUDGED}
    assert all(row.paper is None for row in rows)
    assert "Fig. 1(d)-(f)" in rows[-1].note
    assert main(["compare", str(punched.directory)]) == EXIT_GOOD


def test_with_parameters_of_its_own_the_model_is_judged(punched: Analysis) -> None:
    strong, _ = compare(punched, {"lateral_stiffness": 0.06, "lateral_strength": 1e-6})
    judged = {row.quantity: row.verdict for row in strong if row.model is not None}
    assert judged["lateral force, mean over the drop"] is Verdict.FAIL
    assert len(judged) == 4
    assert Verdict.NOT_JUDGED not in judged.values()


def test_the_report_speaks_of_a_punch(punched: Analysis, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(punched.directory)]) == EXIT_GOOD
    page = re.sub(r"data:[^\"']+", "", (punched.directory / "report.html").read_text())
    assert "drops of the punch pressure/confining stress" in page
    assert "solid fraction of the bed" in page
    assert "The paper counts it for its biaxial test alone." in page
    assert "calibrated on the biaxial test" in page
    assert "peak stress ratio" not in page
    assert "consistently the majority" not in page
    main(["compare", str(punched.directory)])
    assert "not held against it" in capsys.readouterr().out


def test_a_manifest_without_a_script_is_read_as_before(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "plain", (1,))
    manifest = json.loads((directory / "runs" / "seed1" / export_format.MANIFEST).read_text())
    assert name_of_test(manifest) == "biaxial"
    rows, _ = compare(analyse(directory, jobs=1), {})
    assert any(row.paper is not None for row in rows)


def test_the_face_of_the_punch_is_drawn(tmp_path: Path) -> None:
    found = arrays(0.0, 1)
    np.savez(tmp_path / "000000.npz", **found)
    top = found["contact_id2"] == -4
    np.savez(tmp_path / "000001.npz", **found | {"contact_id2": np.where(top, -5, found["contact_id2"])})
    figure, axes = plt.subplots(1, 2)
    for number, ax in enumerate(axes):
        plot_discs(read_snapshot(tmp_path / f"{number:06d}.npz"), ax=ax)
    plt.close(figure)
    without, bars = ([patch for patch in ax.patches if isinstance(patch, Rectangle)] for ax in axes)
    assert without == []
    (bar,) = bars
    disc = found["contact_id1"][top]
    assert bar.get_y() == pytest.approx(1e3 * (found["particle_y"][disc] + RADIUS).mean(), rel=1e-9)
    assert bar.get_x() == pytest.approx(1e3 * (found["particle_x"][disc].min() - RADIUS), rel=1e-9)
    assert bar.get_width() == pytest.approx(1e3 * (np.ptp(found["particle_x"][disc]) + 2 * RADIUS), rel=1e-9)


def test_a_history_that_contradicts_its_punch_pressure_is_seen(punched: Analysis) -> None:
    folder = next((punched.directory / "runs").iterdir())
    run = read_run(folder)
    assert run.history is not None
    agreeing = run.history.assign(axial_stress=run.history["stress_ratio"] * run.parameters["confining_stress"])
    assert run_consistency(replace(run, history=agreeing))["history"] < 1e-12
    assert run_consistency(run)["history"] > 0.1
