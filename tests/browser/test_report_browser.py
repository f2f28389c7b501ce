"""The report in a browser: what is pointed at is told rightly, steps and switches act, nothing comes from elsewhere."""

from __future__ import annotations

import base64
import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest
from browser_page import Browser
from buckling_study import arrays, write_buckling_run
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from harness.cli import main

pytestmark = pytest.mark.browser

MEASURES = (
    "axial_force_N",
    "buckling_angle_deg",
    "axial_displacement_over_R",
    "normal_displacement_over_R",
    "rotation_deg",
    "lateral_force_N",
)
SHOWN = 6e-3  # three digits, of a number kept to four
PHONE = (390, 844)


@pytest.fixture
def page(browser: Browser, study: Path) -> Browser:
    browser.open(study / "report.html")
    return browser


def rows_of(study: Path, run: str, segment: int) -> list[dict[str, str]]:
    """Rows of one segment in segments.csv, by increment."""
    with (study / "analysis" / "segments.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["run"] == run and row["segment"] == str(segment)]
    return sorted(rows, key=lambda row: int(row["increment"]))


def particles(row: dict[str, str]) -> str:
    return ", ".join(row[f"particle_{place}"] for place in (1, 2, 3))


def agree(page: Browser, row: dict[str, str]) -> bool:
    """Whether the numbers shown are those of a row of segments.csv."""
    facts = page.facts()
    shown = [float(re.sub("[ N°]", "", facts[name]).replace("\N{MINUS SIGN}", "-")) for name in MEASURES]
    expected = [float(row[name]) for name in MEASURES]
    return shown == pytest.approx(expected, rel=SHOWN, abs=1e-9) and facts.get("particles") == particles(row)


def place_of(page: Browser, disc: int, run: str, strain: float) -> tuple[float, float]:
    """Where on the canvas a disc must be: the whole window's packing fitted into it, 4 pixels of room all round."""
    data: dict[str, Any] = next(
        view
        for view in (
            json.loads(text)
            for text in page.run(
                "return [...document.querySelectorAll('script[type=\"application/json\"]')].map(one => one.textContent)"
            )
        )
        if view["run"] == run
    )
    content = arrays(strain, int(run.removeprefix("seed")))
    quantum = 1e-3 * data["quantum_mm"]
    x, y = (
        content[f"particle_{axis}"][disc] / quantum - 1e-3 * corner / quantum
        for axis, corner in zip("xy", data["corner_mm"], strict=True)
    )
    width, height = page.run("const c = document.getElementById('x-canvas'); return [c.clientWidth, c.clientHeight]")
    scale = min((width - 8) / data["size"][0], (height - 8) / data["size"][1])
    return (x - data["size"][0] / 2) * scale, (data["size"][1] / 2 - y) * scale


def press(page: Browser, *keys: str) -> None:
    page.find("canvas").send_keys(*keys)
    page.settle()


def test_nothing_is_fetched_and_nothing_complained_of(page: Browser, study: Path) -> None:
    addresses = page.requests()
    assert (study / "report.html").as_uri() in addresses
    assert {address.split(":")[0] for address in addresses} <= {"file", "data"}
    assert [address for address in addresses if address.startswith("file")] == [(study / "report.html").as_uri()]
    assert (
        page.run("return performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length") == 0
    )
    assert page.complaints() == []


def test_a_script_of_other_origin_does_not_run(page: Browser) -> None:
    page.run(
        "const made = document.createElement('script'); made.textContent = 'window.stolen = 1';"
        "document.body.append(made);"
        "document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\"window.stolen = 2\">')"
    )
    page.settle()
    assert page.run("return window.stolen ?? null") is None
    assert any("Content Security Policy" in entry["message"] for entry in page.complaints())


def test_pointing_at_a_segment_shows_its_numbers(page: Browser, study: Path) -> None:
    for segment in (0, 7):
        rows = rows_of(study, "seed1", segment)
        for increment, other in ((0, 28), (16, 12)):
            press(page, Keys.HOME, *[Keys.ARROW_RIGHT] * increment)
            row = rows[increment]
            middle = int(row["particle_2"])
            x, y = place_of(page, middle, "seed1", float(row["axial_strain"]))
            ActionChains(page.driver, duration=0).move_to_element_with_offset(
                page.find("canvas"), round(x), round(y)
            ).perform()
            assert agree(page, row)
            assert not agree(page, rows[other])  # other numbers are told apart
    ActionChains(page.driver, duration=0).move_to_element(page.find("drop")).perform()
    assert "mean" in page.text("facts")


def test_another_drop_shows_its_own(page: Browser, study: Path) -> None:
    before = page.picture()
    page.run(
        "const s = document.getElementById('x-drop');"
        "s.value = [...s.options].find(o => o.text.includes('seed2')).value; s.dispatchEvent(new Event('change'))"
    )
    for _ in range(50):
        if "seed2" in page.text("name"):
            break
        page.settle()
    assert page.picture() != before
    press(page, Keys.ARROW_DOWN)
    assert agree(page, rows_of(study, "seed2", 0)[0])
    assert not agree(page, rows_of(study, "seed1", 0)[0])


def test_keys_step_choose_and_let_go(page: Browser, study: Path) -> None:
    press(page, Keys.ARROW_DOWN, Keys.ARROW_DOWN, *[Keys.ARROW_RIGHT] * 3)
    assert agree(page, rows_of(study, "seed1", 1)[3])
    assert "Segment 1" in page.text("said")
    press(page, Keys.ARROW_UP, Keys.ARROW_LEFT)
    assert agree(page, rows_of(study, "seed1", 0)[2])
    press(page, Keys.ESCAPE, Keys.END)
    assert "increment 28 of 28" in page.text("now")
    assert "particles" not in page.facts()
    last = page.picture()
    press(page, Keys.ARROW_RIGHT)
    assert page.picture() == last
    press(page, Keys.HOME)
    assert page.picture() != last


def test_buttons_and_slider_step_and_the_picture_follows(page: Browser) -> None:
    start = page.picture()
    page.run("const s = document.getElementById('x-step'); s.value = 14; s.dispatchEvent(new Event('input'))")
    assert "increment 14 of 28" in page.text("now")
    pictures = [page.picture()]
    for name, clicks in (("next", 4), ("back", 4), ("last", 1), ("first", 1)):  # one step moves less than a pixel here
        for _ in range(clicks):
            page.find(name).click()
        pictures.append(page.picture())
    middle, after, again, last, first = pictures
    assert again == middle
    assert first == start
    assert len({middle, after, last, first}) == 4


def test_it_plays_to_the_end(page: Browser) -> None:
    press(page, Keys.END, *[Keys.ARROW_LEFT] * 3)
    label = "const b = document.getElementById('x-play'); b.click(); return b.getAttribute('aria-label')"
    assert page.run(label) == "Pause"
    assert page.run(label) == "Play"
    press(page, Keys.SPACE)
    for _ in range(200):
        if page.find("play").get_attribute("aria-label") == "Play":
            break
        page.settle()
    assert "increment 28 of 28" in page.text("now")


def test_switches_hide_and_show(page: Browser) -> None:
    page.find("segments").click()
    whole = page.picture()
    seen = {whole}
    for name in ("discs", "forces", "chains", "segments"):  # these chains lie below their segments
        page.find(name).click()
        without = page.picture()
        assert without not in seen, name
        seen.add(without)
        page.find(name).click()
        assert page.picture() == whole, name


def test_zoom_and_back(page: Browser) -> None:
    whole = page.picture()
    page.find("in").click()
    near = page.picture()
    assert near != whole
    canvas = page.find("canvas")
    ActionChains(page.driver, duration=50).move_to_element(canvas).click_and_hold().move_by_offset(
        60, 40
    ).release().perform()
    assert page.picture() not in (near, whole)
    page.find("whole").click()
    ActionChains(page.driver, duration=0).move_to_element(page.find("drop")).perform()
    assert page.picture() == whole


def test_light_and_dark(page: Browser) -> None:
    ground = "return getComputedStyle(document.body).backgroundColor"
    light, by_day = page.run(ground), page.picture()
    assert not any(page.visible(".by-night"))
    page.look(dark=True)
    assert page.run(ground) != light
    assert page.picture() != by_day
    assert not any(page.visible(".by-day"))
    assert any(page.visible(".by-night"))


def test_a_phone_does_not_scroll_sideways_and_a_tap_chooses(page: Browser, study: Path) -> None:
    page.command(
        "Emulation.setDeviceMetricsOverride", width=PHONE[0], height=PHONE[1], deviceScaleFactor=2, mobile=True
    )
    page.settle()
    assert page.run("return document.documentElement.scrollWidth") <= PHONE[0]
    page.run("for (const one of document.querySelectorAll('details')) one.open = true")
    assert page.run("return document.documentElement.scrollWidth") <= PHONE[0]
    page.run("document.getElementById('x-canvas').scrollIntoView({ block: 'center' })")
    page.settle()
    row = rows_of(study, "seed1", 4)[0]
    x, y = place_of(page, int(row["particle_2"]), "seed1", float(row["axial_strain"]))
    left, top, width, height = page.run(
        "const b = document.getElementById('x-canvas').getBoundingClientRect();"
        "return [b.left, b.top, b.width, b.height]"
    )
    at = {"x": left + width / 2 + x, "y": top + height / 2 + y}
    page.command("Input.dispatchTouchEvent", type="touchStart", touchPoints=[at])
    page.command("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    assert agree(page, row)


def test_printed_it_has_pages_and_the_still_picture(page: Browser) -> None:
    printed = base64.b64decode(page.command("Page.printToPDF", printBackground=True)["data"])
    assert printed.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) >= 3
    assert page.visible(".still") == [False]
    page.look(dark=True, media="print")
    assert page.visible(".still") == [True]
    assert page.visible("#explorer") == [False]
    assert not any(page.visible(".by-night"))


def test_without_scripts_the_still_picture_is_in_place(browser: Browser, study: Path) -> None:
    browser.command("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(study / "report.html", explorer=False)
        assert browser.visible(".still") == [True]
        assert browser.visible("#explorer") == [False]
        assert browser.complaints() == []
    finally:
        browser.command("Emulation.setScriptExecutionDisabled", value=False)


def test_names_from_files_do_not_run(browser: Browser, tmp_path: Path) -> None:
    name = "<!--<script>stolen=1<img src=x onerror=stolen=2>\"'&"
    write_buckling_run(tmp_path / "study" / "runs" / name, 1)
    assert main(["report", str(tmp_path / "study")]) == 0
    browser.open(tmp_path / "study" / "report.html")
    assert browser.run("return typeof stolen") == "undefined"
    assert name in browser.text("name")
    assert browser.complaints() == []
