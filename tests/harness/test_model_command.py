"""`forcechain model` from the outside: columns, values, one-line errors, figures."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from harness import cli
from harness.commands.model import FIGURES
from harness.modelling.model_tables import COLUMNS

PRINTED = {  # t [deg]: stage, F [N], d, D/R, w [deg] of Table 3
    5.0: ("1b", 10.896666670, 0.090686730, 0.195904487, 0.272027965),
    14.0: ("2", 9.273071418, 0.075168100, 0.264687667, 0.755079573),
    20.0: ("2", 7.214467922, 0.056636443, 0.347671213, 1.067503308),
    25.0: ("3", 5.207104560, 0.039425559, 0.446232234, 16.158226419),
}


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    status = cli.main(["model", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_angles_print_the_values_of_table_3(capsys):
    status, out, err = run(capsys, "--angles", "5,14,20,25")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == ",".join(COLUMNS)
    for row, (angle, (stage, force, overlap, displacement, rotation)) in zip(table(out), PRINTED.items(), strict=True):
        assert float(row["buckling_angle_deg"]) == angle
        assert row["stage"] == stage
        assert float(row["axial_force_N"]) == pytest.approx(force, abs=0.51e-9)
        assert float(row["normal_displacement_over_R"]) == pytest.approx(overlap, abs=0.51e-9)
        assert float(row["axial_displacement_over_R"]) == pytest.approx(displacement, abs=0.51e-9)
        assert float(row["rotation_deg"]) == pytest.approx(rotation, abs=0.51e-9)


def test_default_grid_passes_through_every_stage(capsys):
    _, out, _ = run(capsys)
    rows = table(out)
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    assert stages == ["1a", "1b", "2", "3"]
    assert float(rows[0]["axial_force_N"]) == 0
    assert max(float(row["axial_force_N"]) for row in rows) == pytest.approx(10.942468405, abs=1e-9)
    _, out, _ = run(capsys, "--set", "rolling_friction=0.02")
    assert list(dict.fromkeys(row["stage"] for row in table(out))) == ["1a", "1b", "2'", "3"]
    _, out, _ = run(capsys, "--set", "imperfection_deg=65")
    assert float(table(out)[0]["buckling_angle_deg"]) == 65
    assert table(out)[0]["stage"] == "2'"  # so far off line the moment has too little normal force to hold at all


def test_unloading(capsys):
    _, out, _ = run(capsys, "--unload-from", "25")
    rows = table(out)
    assert list(dict.fromkeys(row["stage"] for row in rows)) == ["1a", "1b", "2", "3", "4", "4'"]
    assert float(rows[-1]["axial_force_N"]) == pytest.approx(0, abs=1e-9)
    _, out, _ = run(capsys, "--unload-from", "8")
    rows = table(out)
    assert list(dict.fromkeys(row["stage"] for row in rows)) == ["1a", "1b", "4"]
    assert rows[-1]["stage"] == "1a"
    assert float(rows[-1]["axial_force_N"]) == 0
    _, out, _ = run(capsys, "--unload-from", "25", "--angles", "24,20")
    assert [row["stage"] for row in table(out)] == ["4", "4"]
    assert float(table(out)[1]["axial_force_N"]) == pytest.approx(4.2998893, abs=1e-6)
    _, out, _ = run(capsys, "--unload-from", "25", "--angles", "13", "--hold-sliders")
    assert table(out)[0]["stage"] == "4"
    status, _, err = run(capsys, "--unload-from", "25", "--angles", "3")
    assert status == 2
    assert "the path ends before this angle" in err


def test_prescribed_displacements_skip_what_snaps(capsys):
    arguments = ("--set", "rolling_friction=0.02", "--displacements", "0.1,0.1904,0.1906")
    status, out, err = run(capsys, *arguments)
    rows = table(out)
    assert (status, err) == (0, "")
    assert [row["stage"] for row in rows] == ["1a", "1b", "2'"]
    assert float(rows[2]["axial_force_N"]) < 0.8 * float(rows[1]["axial_force_N"])
    assert [float(row["axial_displacement_over_R"]) for row in rows] == pytest.approx([0.1, 0.1904, 0.1906], abs=1e-12)


def test_sweep_adds_its_name_as_a_column(capsys):
    _, out, _ = run(capsys, "--sweep", "rolling_friction=0.02,0.2", "--angles", "5,25")
    rows = table(out)
    assert list(rows[0]) == ["rolling_friction", *COLUMNS]
    assert [row["rolling_friction"] for row in rows] == ["0.02", "0.02", "0.2", "0.2"]
    assert rows[0]["stage"] == "2'"
    assert rows[2]["stage"] == "1b"


def test_json_has_yield_angles_status_and_stability(capsys):
    _, out, _ = run(capsys, "--angles", "14", "--json")
    (record,) = json.loads(out)
    assert record["lateral_yield_deg"] == pytest.approx(11.536959, abs=1e-6)
    assert record["moment_yield_deg"] == pytest.approx(22.311269, abs=1e-6)
    assert record["points"][0]["stability"] == "displacement_controlled"
    assert record["points"][0]["status"] == "equilibrium"
    _, out, _ = run(capsys, "--angles", "14", "--json", "--set", "rolling_stiffness=0")
    assert json.loads(out)[0]["moment_yield_deg"] is None


def test_column_of_many_particles(capsys):
    _, out, _ = run(capsys, "--particles", "3")
    rows = table(out)
    assert list(rows[0]) == list(COLUMNS)
    near = min(rows, key=lambda row: abs(float(row["buckling_angle_deg"]) - 25))
    _, closed, _ = run(capsys, "--angles", near["buckling_angle_deg"])
    for name in COLUMNS[2:]:
        assert float(near[name]) == pytest.approx(float(table(closed)[0][name]), rel=1e-8)
    status, out, _ = run(capsys, "--particles", "12", "--mode", "2", "--unload-from", "30", "--json")
    record = json.loads(out)
    assert status == 0
    assert record["particles"] == 12
    assert len(record["points"][0]["rotations_deg"]) == 12
    assert record["points"][-1]["stage"] == "4"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "roling_friction=0.1"], "--set roling_friction: no such parameter; did you mean rolling_friction?"),
        (["--set", "rolling_friction"], "expected NAME=VALUE"),
        (["--set", "rolling_friction=soft"], "--set rolling_friction: expected a finite number, found 'soft'"),
        (["--set", "rolling_friction=nan"], "expected a finite number, found 'nan'"),
        (["--set", "rolling_friction=-1"], "rolling_friction: expected a finite number of at least 0, found -1"),
        (["--set", "rolling_friction=1,2"], "expected one number, found 2"),
        (["--set", "rolling_friction=1", "--set", "rolling_friction=2"], "given twice"),
        (["--set", "imperfection_deg=90"], "below pi/2 rad (90 degrees)"),
        (["--set", "lateral_stiffness=0.6"], "no buckling"),
        (["--angles", "95"], "--angles: expected at least 0 and below 90 deg, found 95"),
        (["--angles", "90"], "90 deg: outside the model"),
        (["--set", "imperfection_deg=5", "--angles", "3"], "below that of the unloaded column"),
        (["--unload-from", "95"], "--unload-from: expected an angle above"),
        (["--unload-from", "20", "--angles", "21"], "at most the angle of unloading, 20 deg, found 21"),
        (["--unload-from", "30", "--set", "lateral_strength=1e-5"], "loading ends at"),
        (["--sweep", "rolling_friction"], "expected NAME=A,B"),
        (["--sweep", "rolling_friction=0.1", "--set", "rolling_friction=1"], "--set does not fix"),
        (["--sweep", "rolling_friction=0.1", "--unload-from", "20"], "not with --sweep"),
        (["--particles", "2"], "from 3 to 200, found 2"),
        (["--particles", "3.5"], "whole number"),
        (["--particles", "5", "--mode", "9"], "mode: expected"),
        (["--particles", "5", "--mode", "0"], "--mode: expected 1 or more"),
        (["--particles", "5", "--angles", "3"], "only for three particles"),
        (["--displacements", "0.1", "--angles", "3"], "--displacements: not with --angles"),
        (["--displacements", "-0.1"], "expected finite numbers of at least 0, found -0.1"),
        (["--displacements", "4"], "below 90 degrees"),
        (["--mode", "2"], "only with --particles"),
        (["--hold-sliders"], "only with --unload-from"),
        (["--figure", "modes"], "only with --plot"),
        (["--plot", "figure.gif"], "expected a name that ends in .png"),
        (["--plot", "no/such/folder/a.png"], "cannot be written"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(capsys, arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *arguments)
    assert status == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert message in err


def test_a_fold_is_noted_but_printed(capsys):
    status, out, err = run(capsys, "--set", "lateral_stiffness=1e-4", "--angles", "5,20")
    assert status == 0
    assert len(table(out)) == 2
    assert "from 20 deg on" in err


@pytest.mark.parametrize("figure", FIGURES)
def test_figures_are_written(capsys, tmp_path, figure):
    file = tmp_path / f"{figure}.png"
    status, out, err = run(capsys, "--plot", str(file), "--figure", figure)
    assert (status, out) == (0, "")
    assert str(file) in err
    assert file.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 10_000


@pytest.mark.parametrize(
    "arguments",
    [
        ["--particles", "30", "--unload-from", "35"],
        ["--sweep", "rolling_friction=0.01,0.02,0.05,0.1,0.2"],
        ["--unload-from", "30"],
        ["--set", "imperfection_deg=3"],
    ],
)
def test_plots_of_what_was_asked_for(capsys, tmp_path, arguments):
    file = tmp_path / "figure.svg"
    status, _, _ = run(capsys, *arguments, "--plot", str(file))
    assert status == 0
    assert "<svg" in file.read_text()


def test_plot_and_table_agree():
    """What the figure draws is the path the table prints."""
    from forcechain.theory.parameters import TABLE_3
    from forcechain.theory.three_particle import loading
    from harness.figures.theory import path_curve

    curve = path_curve(TABLE_3)
    buckled = curve["angle"] > 0
    state = loading(TABLE_3, np.radians(curve["angle"][buckled]))
    np.testing.assert_allclose(curve["force"][buckled], state.axial_force, rtol=1e-13)
    np.testing.assert_allclose(curve["displacement"][buckled], state.axial_displacement_over_R, rtol=1e-13)
