"""The report is one file that needs no other, and says what the analysis says."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import re
import xml.etree.ElementTree as ET
import zlib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from buckling_study import arrays, write_buckling_run, write_buckling_study
from PIL import Image

from harness.cli import main

VOID = {"meta", "img", "br", "input"}


class Page(HTMLParser):
    """Collects what the tests ask of a page, and that every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "img":
            self.images.append(values)
        self.links += [value for name in ("src", "href") if (value := values.get(name))]
        if values.get("id"):
            self.ids.add(str(values["id"]))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", (1, 2))
    assert main(["report", str(directory), "--figures", str(directory / "figures"), "--format", "pdf"]) == 0
    return directory


@pytest.fixture(scope="module")
def text(study: Path) -> str:
    return (study / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


@pytest.fixture(scope="module")
def view(text: str) -> dict[str, Any]:
    """The first drop of the explorer."""
    found = re.search(r'<script type="application/json" id="view-0">(.*?)</script>', text)
    assert found
    return dict(json.loads(found[1]))


def unpacked(packed: dict[str, Any]) -> np.ndarray:
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed["content"])), dtype=np.uint8)
    width = int(packed["type"][1:])
    values = np.ascontiguousarray(planes.reshape(width, -1).T).view(f"<{packed['type']}")
    return values.reshape(packed["shape"])


def test_the_page_is_whole_and_fetches_nothing(page: Page) -> None:
    assert page.open == []
    for link in page.links:
        assert link.startswith(("data:image/", "#")), link
        if link.startswith("#"):
            assert link[1:] in page.ids


def test_every_figure_is_there_by_day_and_by_night_and_described(page: Page) -> None:
    assert len(page.images) == 2 * 4 + 1  # summary, behaviour, filters, buckling; the explorer's stand-in is for paper
    for image in page.images:
        assert len(str(image["alt"])) > 40
        kind, _, content = str(image["src"]).partition(";base64,")
        data = base64.b64decode(content)
        if kind == "data:image/svg+xml":
            assert len(list(ET.fromstring(data).iter())) > 100
        else:
            assert data.startswith(b"\x89PNG")
    assert len({image["src"] for image in page.images}) == len(page.images)


def test_the_explorer_has_the_positions_and_forces_of_every_increment(view: dict[str, Any], study: Path) -> None:
    position = np.cumsum(unpacked(view["position"]), axis=0)
    force = np.cumsum(unpacked(view["force"]), axis=0) * view["force_unit_N"]
    pairs = np.cumsum(unpacked(view["contacts"]), axis=0)
    assert view["steps"] == list(range(29))
    for step in (0, 17, 28):
        content = arrays(view["strain"][step], int(view["run"].removeprefix("seed")))
        for axis, name in enumerate("xy"):
            found = position[step, axis] * view["quantum_mm"] + view["corner_mm"][axis]
            assert found == pytest.approx(1e3 * content[f"particle_{name}"], abs=2e-3 * view["quantum_mm"] * 1e3)
        told = {tuple(pair): value for pair, value in zip(pairs.tolist(), force[step], strict=True)}
        ids = zip(content["contact_id1"], content["contact_id2"], content["contact_fn"], strict=True)
        assert told == pytest.approx({(one, other): load for one, other, load in ids}, abs=view["force_unit_N"])
    with (study / "analysis" / "segments.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if (row["run"], row["drop"]) == (view["run"], str(view["drop"]))]
    assert len(rows) == 29 * len(view["segments"])
    measures = json.loads(unpacked(view["measures"]).tobytes())
    assert len(measures) == 6
    for row in rows:
        for name, values in measures.items():
            told_value = values[int(row["increment"])][int(row["segment"])]
            assert told_value == pytest.approx(float(row[name]), rel=1e-3, abs=1e-12)


def test_only_the_pages_own_script_and_style_may_act(text: str) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', text)
    assert policy
    assert policy[1].startswith("default-src 'none'; img-src data:; style-src 'sha256-")
    assert "unsafe" not in policy[1]
    for tag in ("style", "script"):
        found = re.search(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        assert found
        digest = base64.b64encode(hashlib.sha256(found[1].encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy[1]
    assert " style=" not in text
    assert not re.search(r"\son[a-z]+=", text)


def _contrast(one: str, other: str) -> float:
    """Contrast of two colours "#rrggbb" as WCAG 2 defines it."""

    def luminance(colour: str) -> float:
        parts = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_what_is_written_stands_out_by_day_and_by_night(text: str) -> None:
    blocks = re.findall(r":root \{(.*?)\}", text, re.DOTALL)[:2]
    for block in blocks:
        colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", block))
        for ground in ("page", "card"):
            for name in ("ink", "soft", "good", "bad", "accent"):
                assert _contrast(colours[name], colours[ground]) >= 4.5, (name, ground)
    assert _contrast("#777777", "#888888") < 4.5


def test_the_page_tells_verdicts_counts_parameters_and_provenance(page: Page) -> None:
    text = " ".join(page.text)
    for words in (
        "rows pass",
        "FAIL",
        "axial force, mean over the drop",
        "candidate segments",
        "rolling_stiffness_ratio",
        "segment_rule",
        "2023.02a",
        "largest error of the confining stress",
    ):
        assert words in text, words


def test_figures_can_be_had_as_files(study: Path) -> None:
    names = {path.name for path in (study / "figures").iterdir()}
    assert names == {f"{stem}-0.pdf" for stem in ("summary", "behaviour", "filters", "forces", "buckling")}
    assert all(path.read_bytes().startswith(b"%PDF") for path in (study / "figures").iterdir())


def test_chains_can_be_had_at_any_strain_dark_and_of_any_width(study: Path, text: str, tmp_path: Path) -> None:
    figures = tmp_path / "figures"
    command = [
        "report",
        str(study),
        "--output",
        str(tmp_path / "r.html"),
        "--figures",
        str(figures),
        "--strain",
        "0.002",
        "--width-mm",
        "120",
    ]
    assert main([*command, "--dark"]) == 0
    with Image.open(figures / "network-seed1-0.0020.png") as image:
        assert image.width == pytest.approx(120 / 25.4 * 300, abs=1)
        assert image.convert("RGB").getpixel((2, 2)) == (18, 23, 29)
    # a report made twice is the same, the figures asked for or not
    made = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC")
    assert made.sub("", (tmp_path / "r.html").read_text(encoding="utf-8")) == made.sub("", text)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--animate", "a.avi"], "expected a name that ends in .gif or .mp4, found .avi"),
        (["--strain", "0.002"], "--strain is of --figures"),
        (["--drop", "1"], "--drop is of --animate"),
        (["--animate", "a.gif", "--drop", "1"], "give --run ID too"),
        (["--run", "seed1"], "--run is of --animate and --strain"),
        (["--animate", "a.gif", "--run", "seed9"], "expected one of seed1, seed2, found 'seed9'"),
        (["--animate", "a.gif", "--run", "seed1", "--drop", "7"], "expected drop 7 to animate, found drops 1 to 1"),
        (["--figures", "f", "--strain", "0.5"], "expected an axial strain from 0 to 0.011, found 0.5"),
    ],
)
def test_what_cannot_be_had_is_said_in_a_line(
    study: Path, arguments: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = [str(tmp_path / one) if one in ("a.gif", "f") else one for one in arguments]
    assert main(["report", str(study), "--output", str(tmp_path / "r.html"), *arguments]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "a.gif").exists()


def test_an_mp4_without_ffmpeg_says_what_to_do(
    study: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["report", str(study), "--animate", str(tmp_path / "a.mp4")]) == 2
    assert "an MP4 needs ffmpeg, found none; apt-get install ffmpeg" in capsys.readouterr().err


def test_names_from_files_are_escaped_and_the_drop_moves(tmp_path: Path) -> None:
    directory = tmp_path / "<b>zigzag&"
    name = "<!--<script>alert(1)<script>"
    write_buckling_run(directory / "runs" / name, 1)
    animation = tmp_path / "drop.gif"
    output = ["--output", str(tmp_path / "report.html"), "--animate", str(animation)]
    assert main(["report", str(directory), *output]) == 0
    text = (tmp_path / "report.html").read_text()
    assert "<script>alert" not in text
    assert "<!--" not in text
    assert "<b>zig" not in text
    assert "&lt;script&gt;alert" in text
    assert r'"run":"\u003c!--\u003cscript\u003ealert(1)' in text
    with Image.open(animation) as image:
        assert getattr(image, "n_frames", 1) > 10  # what does not move is one frame
        first = image.convert("RGB").tobytes()
        image.seek(10)
        assert image.convert("RGB").tobytes() != first


def test_a_study_without_drops_still_has_a_report(tmp_path: Path) -> None:
    run = write_buckling_run(tmp_path / "calm" / "runs" / "seed1", 1)
    (run / "run.json").unlink()
    history = (run / "history.csv").read_text().splitlines()
    column = history[0].split(",").index("stress_ratio")
    calm = [history[0]]
    for number, line in enumerate(history[1:]):
        cells = line.split(",")
        cells[column] = f"{0.001 * number:.6f}"
        calm.append(",".join(cells))
    (run / "history.csv").write_text("\n".join(calm) + "\n")
    assert main(["report", str(tmp_path / "calm")]) == 0
    assert "No drop was found" in (tmp_path / "calm" / "report.html").read_text()
