"""The report is one file that needs no other, and says what the analysis says."""

from __future__ import annotations

import base64
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import pytest
from buckling_study import write_buckling_run, write_buckling_study

from harness.cli import main

VOID = {"meta", "img", "br"}


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
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    directory = write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", (1, 2))
    assert main(["report", str(directory)]) == 0
    return Page((directory / "report.html").read_text(encoding="utf-8"))


def test_the_page_is_whole_and_fetches_nothing(page: Page) -> None:
    assert page.open == []
    for link in page.links:
        assert link.startswith(("data:image/", "#")), link
        if link.startswith("#"):
            assert link[1:] in page.ids


def test_every_figure_is_there_and_described(page: Page) -> None:
    assert len(page.images) == 5  # summary, behaviour, filters, forces, buckling
    for image in page.images:
        assert len(str(image["alt"])) > 40
        kind, _, content = str(image["src"]).partition(";base64,")
        assert kind == "data:image/svg+xml"
        root = ET.fromstring(base64.b64decode(content))
        assert len(list(root.iter())) > 100


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


def test_the_same_study_gives_the_same_figures(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1,))
    pages = []
    for name in ("a.html", "b.html"):
        assert main(["report", str(directory), "--output", str(tmp_path / name)]) == 0
        pages.append(re.findall(r'src="([^"]+)"', (tmp_path / name).read_text()))
    assert pages[0] == pages[1]


def test_figures_can_be_had_as_files(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1,))
    assert main(["report", str(directory), "--figures", str(tmp_path / "figures"), "--format", "pdf"]) == 0
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"{stem}-0.pdf" for stem in ("summary", "behaviour", "filters", "forces", "buckling")}
    assert all(path.read_bytes().startswith(b"%PDF") for path in (tmp_path / "figures").iterdir())


def test_names_from_files_are_escaped(tmp_path: Path) -> None:
    directory = tmp_path / "<b>zigzag&"
    write_buckling_run(directory / "runs" / "<script>alert(1)<script>", 1)
    assert main(["report", str(directory), "--output", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text()
    assert "<script" not in text
    assert "<b>" not in text
    assert "&lt;script&gt;" in text


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
