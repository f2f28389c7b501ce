"""forcechain compare --with: what moves from one study to another, and how much of it is chance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from buckling_study import FORCE, LATERAL, write_buckling_run, write_buckling_study

from harness.cli import main
from harness.comparing.run_numbers import QUANTITIES
from harness.comparing.variations import Difference, difference_text, differences

NAMES = [quantity.name for quantity in QUANTITIES]
PEAK = "peak_stress_ratio"


def table(values: dict[str, float], quantity: str = PEAK) -> pd.DataFrame:
    """Numbers of a study: one quantity by seed, nothing of the others."""
    return pd.DataFrame({quantity: values}, columns=NAMES, dtype=np.float64)


def of(found: tuple[Difference, ...], study: str, quantity: str = PEAK) -> Difference:
    return next(d for d in found if d.study == study and d.quantity.name == quantity)


def test_one_other_study_gives_the_paired_test() -> None:
    base = table({"seed 1": 0.70, "seed 2": 0.72, "seed 3": 0.71})
    other = table({"seed 1": 0.65, "seed 2": 0.68, "seed 3": 0.64, "seed 9": 5.0})
    found = of(differences({"base": base, "other": other}, "base"), "other")
    each = np.array([-0.05, -0.04, -0.07])
    assert found.seeds == 3
    assert found.difference == pytest.approx(each.mean())
    assert found.standard_error == pytest.approx(each.std(ddof=1) / np.sqrt(3))
    assert found.degrees_of_freedom == 2
    assert found.reach == pytest.approx(4.302653 * each.std(ddof=1) / np.sqrt(3), rel=1e-6)
    assert found.mark == "*" or found.mark == "**"
    assert of(differences({"base": base, "other": other}, "base"), "other", "coordination").difference is None


def test_chance_marks_one_difference_in_twenty_and_a_shift_is_marked() -> None:
    rng = np.random.default_rng(3)
    seeds = ["seed 1", "seed 2", "seed 3"]
    plain, shifted, with_any = [], [], 0
    for _ in range(20):
        packing = rng.normal(size=(3, len(NAMES)))
        drawn = {
            name: pd.DataFrame(packing + rng.normal(size=packing.shape), index=seeds, columns=NAMES) for name in "abcd"
        }
        drawn["shifted"] = drawn["b"].iloc[:2] + 8 + rng.normal(size=(2, len(NAMES)))
        found = differences(drawn, "a")
        marks = [difference.mark for difference in found if difference.study in "bcd"]
        plain += marks
        with_any += "**" in marks
        shifted += [difference.mark for difference in found if difference.study == "shifted"]
    assert 0.02 < sum(mark != "" for mark in plain) / len(plain) < 0.08
    assert with_any <= 3
    assert sum(mark != "" for mark in shifted) > 0.9 * len(shifted)


def test_a_single_shared_seed_is_judged_by_the_chance_of_the_others() -> None:
    base = table({"seed 1": 1.0, "seed 2": 2.0})
    other = table({"seed 1": 1.1, "seed 2": 2.3})
    found = differences({"base": base, "other": other, "single": table({"seed 1": 4.0})}, "base")
    assert of(found, "single").reach == pytest.approx(of(found, "other").reach * np.sqrt(2))
    alone = of(differences({"base": base, "single": table({"seed 1": 4.0})}, "base"), "single")
    assert alone.difference == pytest.approx(3.0)
    assert alone.reach is None
    assert alone.mark == ""


def test_a_study_the_quantity_does_not_reach_tells_nothing_of_chance() -> None:
    base = table({"seed 1": 1.0, "seed 2": 2.0})
    numbers = {"base": base, "same": base, "other": table({"seed 1": 1.1, "seed 2": 2.3})}
    without = {name: numbers[name] for name in ("base", "other")}
    found = differences(numbers, "base")
    assert difference_text(of(found, "same")) == "0"
    assert of(found, "other").reach == of(differences(without, "base"), "other").reach


def test_two_studies_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base = write_buckling_study(tmp_path / "before", (1, 2, 3))
    for seed in (1, 2, 3):
        write_buckling_run(tmp_path / "after" / "runs" / f"seed{seed}", seed, force_factor=1.0 + 0.1 * seed)
    assert main(["compare", str(base), "--with", str(tmp_path / "after"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    rows = {row["quantity"]: row for row in document["differences"]}
    force = rows["axial force, start of the drop"]
    assert force["difference"] == pytest.approx(0.2 * force["base"], rel=2e-3)  # the axial force follows the angle too
    assert FORCE[1] < force["base"] <= FORCE[0]
    assert force["seeds"] == 3
    assert force["mark"] == ""  # 10, 20 and 30 %: three seeds that differ so much tell little
    assert rows["lateral force, support"]["base"] == pytest.approx(LATERAL)
    assert rows["initial buckling angle"]["difference"] == pytest.approx(0, abs=1e-9)
    assert main(["compare", str(base), "--with", str(tmp_path / "after")]) == 0
    text = capsys.readouterr().out
    assert "nothing differs" in text
    assert "Bonferroni" in text


def test_what_cannot_be_paired_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base = write_buckling_study(tmp_path / "before", (1, 2))
    other = write_buckling_study(tmp_path / "after", (7,))
    assert main(["compare", str(base), "--with", str(other)]) == 2
    assert "expected a seed of before (seed 1, seed 2), found seed 7" in capsys.readouterr().err
    assert main(["compare", str(base), "--with", str(other), "--case", "none"]) == 2
    assert "expected one of the cases rolling_friction 0.2, found 'none'" in capsys.readouterr().err
    assert main(["compare", str(base), "--case", "none"]) == 2
    assert "--case: expected with --with" in capsys.readouterr().err
