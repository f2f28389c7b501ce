"""The reference page: every printed number beside ours, the same bytes every time; the shipped page is up to date."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from buckling_study import write_buckling_study

from harness.analysing.analysis import analyse
from harness.analysing.averages import class_shares as shares_of
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.comparing import paper
from harness.comparing.verdicts import Verdict
from harness.reference.printed import class_shares, over_packings, printed_case, printed_numbers

ROOT = Path(__file__).parents[2]
SHIPPED, PAGE = ROOT / "reference" / "paper", ROOT / "docs" / "reference.md"
LARGEST_PICTURE = 300_000  # bytes
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", (1, 2, 3))
    analyse(directory, jobs=1)
    return directory


@pytest.fixture(scope="module")
def found(study: Path) -> Analysis:
    return analyse(study, jobs=1)


def with_classes(found: Analysis, shares: tuple[float, ...], rng: np.random.Generator, n: int = 400) -> Analysis:
    """The study with `n` segments a run whose classes are drawn with these shares, in per cent."""
    p = np.array(shares) / sum(shares)
    tables = [
        pd.DataFrame({"run": run, "case": case, "buckling_class": rng.choice([1, 2, 3, 4], n, p=p), "slides_first": 0})
        for run, case in zip(found.runs["run"], found.runs["case"], strict=True)
    ]
    yielding = pd.concat(tables, ignore_index=True)
    return replace(found, yielding=yielding, classes=shares_of(yielding))


def test_shares_pass_near_the_print_and_fail_away_from_it(found: Analysis) -> None:
    rng = np.random.default_rng(3)
    (case,) = found.cases
    near = class_shares(case, with_classes(found, paper.TABLE_1[0.2], rng))
    assert [row.printed for row in near] == ["7.1", "14.8", "44.1", "34.0", "48.8", "< 5"]
    assert {row.verdict for row in near} == {Verdict.PASS}
    assert near[4].found == pytest.approx(near[1].found + near[3].found)
    far = class_shares(case, with_classes(found, paper.TABLE_1[0.02], rng))
    assert [row.verdict for row in far] == [*[Verdict.FAIL] * 5, Verdict.PASS]
    sliding = with_classes(found, paper.TABLE_1[0.2], rng)
    sliding = replace(sliding, classes=shares_of(sliding.yielding.assign(slides_first=1)))
    assert class_shares(case, sliding)[-1].verdict is Verdict.FAIL
    for percent, verdict in (
        (5.5, Verdict.PASS),
        (6.5, Verdict.UNDECIDED),
        (7.5, Verdict.UNDECIDED),
        (8.5, Verdict.FAIL),
    ):
        known = replace(sliding, classes=sliding.classes.assign(percent=percent, percent_se=1.0))
        assert class_shares(case, known)[-1].verdict is verdict
    smooth = replace(found, runs=found.runs.assign(rolling_friction=0.1))
    assert class_shares(case, smooth) == []  # the paper has no such row


def test_drops_are_held_against_the_printed_strains(found: Analysis) -> None:
    (case,) = found.cases
    starts = pd.DataFrame(
        {
            "run": np.repeat(found.runs["run"].to_numpy(), 3),
            "case": case,
            "drop": [1, 2, 3] * 3,
            "start": [0.046, 0.059, 0.080, 0.047, 0.060, 0.081, 0.045, 0.058, 0.079],
        }
    )
    three = replace(found, drops=starts, runs=found.runs.assign(drops=3))
    rows = printed_numbers(case, three, [], {}, {})
    assert [row.verdict for row in rows] == [Verdict.PASS] * 4
    late = printed_numbers(case, replace(three, drops=starts.assign(start=starts["start"] + 0.02)), [], {}, {})
    assert [row.verdict for row in late] == [Verdict.PASS, *[Verdict.FAIL] * 3]
    edge = printed_numbers(case, replace(three, drops=starts.assign(start=starts["start"] + 0.0052)), [], {}, {})
    assert [row.verdict for row in edge] == [Verdict.PASS, *[Verdict.UNDECIDED] * 3]  # 0.0002 beyond, known to 0.0006
    assert rows[1].found == pytest.approx(0.046)
    assert rows[1].interval_text == "0.0435 to 0.0485"  # 0.001/sqrt(3) times Student's 4.303


def test_the_case_of_the_print_is_the_one_under_its_conditions(found: Analysis) -> None:
    assert printed_case(found) is None  # discs of one size
    (case,) = found.cases
    assert printed_case(replace(found, runs=found.runs.assign(**paper.CONDITIONS))) == case
    assert over_packings(1.0, 0.1, 1) == over_packings(None, 0.1, 5) == (None, None)


def test_the_page_is_the_same_bytes_every_time_and_keeps_variations_and_remarks(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_buckling_study(tmp_path / "other", (1, 2))
    (study / "remarks.md").write_text("We differ because | of *this*.")
    pages = []
    for name, more in (("one", ["--with", str(other)]), ("two", [])):  # the table of the first is kept for the second
        output = tmp_path / name / "page.md"
        assert main(["reference", str(study), "--output", str(output), *more]) == 0
        images = sorted((tmp_path / name / "images" / "page").iterdir())
        pages.append({path.name: path.read_bytes() for path in (output, *images)})
    assert capsys.readouterr().err == ""
    assert pages[0] == pages[1]
    text = pages[0]["page.md"].decode()
    assert set(re.findall(r"\]\((images/page/[^)]+)\)", text)) == {f"images/page/{path.name}" for path in images}
    assert "| 3 support first | % | 44.1 |" in text
    assert "## Where we differ, and why" in text
    assert "- `other`:" in text
    assert "We differ because | of *this*." in text

    (study / "variations.json").write_text(json.dumps({"header": 3}))
    assert main(["reference", str(study), "--output", str(tmp_path / "page.md")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "page.md").exists()


def differing(ours: str, shipped: str) -> list[tuple[str, str]]:
    """Lines that differ in words, or in a number by more than a step of its last digit: machines round their sums."""

    def same(one: str, other: str) -> bool:
        first, second = NUMBER.findall(one), NUMBER.findall(other)
        if NUMBER.sub("0", one) != NUMBER.sub("0", other) or len(first) != len(second):
            return False
        steps = (10.0 ** -len(number.partition(".")[2]) for number in second)
        return all(abs(float(a) - float(b)) <= 1.01 * step for a, b, step in zip(first, second, steps, strict=True))

    lines, expected = ours.splitlines(), shipped.splitlines()
    found = [(one, other) for one, other in zip(lines, expected, strict=False) if not same(one, other)]
    return found + [("", line) for line in expected[len(lines) :]] + [(line, "") for line in lines[len(expected) :]]


def test_the_shipped_page_is_what_the_shipped_results_give(tmp_path: Path) -> None:
    output = tmp_path / "docs" / "reference.md"
    assert main(["reference", str(SHIPPED), "--output", str(output)]) == 0
    assert differing(output.read_text(), PAGE.read_text()) == []
    made = {path.name for path in (output.parent / "images" / "reference").iterdir()}
    shipped = {path.name: path.stat().st_size for path in (PAGE.parent / "images" / "reference").iterdir()}
    assert shipped.keys() == made
    assert max(shipped.values()) < LARGEST_PICTURE


def test_the_shipped_results_pass_their_baseline(capsys: pytest.CaptureFixture[str]) -> None:
    gate = ["check", str(SHIPPED), "--baseline", str(ROOT / "baselines" / "paper.toml"), "--json"]
    assert main(gate) == 0
    told = json.loads(capsys.readouterr().out)
    assert len({line["case"] for line in told["lines"] if line["case"]}) == 3
    assert sum("same tables" in line["tolerance_source"] for line in told["lines"]) > 50


def test_a_page_that_differs_is_told() -> None:
    assert differing("| a | 0.71 |", "| a | 0.70 |") == []
    assert differing("| a | 0.71 |", "| a | 0.69 |") != []
    assert differing("| a | 0.71 |", "| b | 0.71 |") != []
    assert differing("a\nb", "a") == [("b", "")]
