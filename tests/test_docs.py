"""Everything that the pages show is run, and every link on them leads somewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlparse

import docs_blocks
import pytest
import yaml
from buckling_study import write_buckling_run
from markdown.extensions.toc import slugify, unique

from harness.analysing.analysis_options import read_options
from harness.comparing.comparison import calibrated_ratios
from harness.errors import InputError
from harness.running.yade_environment import find_yade
from harness.study import STUDY_COPY, plan_text, read_study

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
RUN = {"sh", "console", "python"}
READ = {"toml", "yaml"}  # parsed; a study file is checked as `forcechain run` does
SHOWN = {"text", "lammps"}
# Blocks that are not run, and why: page, and what the block says itself.
NOT_RUN = {
    ("README.md", "the tests are part of it"),
    ("tutorial.md", "it installs programs"),
    ("batch-tables.md", "four runs of twelve seconds"),  # tests/harness/test_batch_tables.py has smaller ones
    ("cluster.md", "it starts servers"),  # tests/harness/test_engines_dask.py does
    ("cluster.md", "it needs SLURM"),
    ("cluster.md", "it writes keys"),
}
INSIDE_YADE = "inside YADE"  # python blocks of a page that are one script
FILE_NAME = re.compile(r"[\w-]+\.\w+")  # a title that names the file which the block is
MEASURED = {"tutorial.md"}  # pages that show what YADE gave: another release gives other numbers in the same tables
LINK = re.compile(r"!?\[(?:[^\]\[]|\[[^\]]*\])*\]\(([^()\s]+(?:\([^()\s]*\))?)\)")


def name(page: Path) -> str:
    return page.relative_to(DOCS).as_posix() if DOCS in page.parents else page.name


def needs_yade(page: Path) -> bool:
    commands = [block.text for block in docs_blocks.blocks_of(page) if not block.not_run]
    return any(re.search(r"forcechain (run|demo|doctor)\b|^import yade\b", text, re.M) for text in commands)


def as_parameters(pages: list[Path]) -> list[object]:
    return [pytest.param(page, id=name(page), marks=[pytest.mark.yade] if needs_yade(page) else []) for page in pages]


@pytest.fixture(scope="module")
def _prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder like a checkout's, with the results of the demo, made by hand so that chains buckle."""
    folder = tmp_path_factory.mktemp("prepared")
    shutil.copytree(ROOT / "studies", folder / "studies")
    shutil.copytree(DOCS / "examples", folder / "examples")
    shutil.copytree(DOCS / "examples", folder / "docs" / "examples")
    shutil.copytree(ROOT / "tests" / "data" / "lammps", folder / "dumps")
    study = read_study(folder / "studies" / "demo.toml")
    results = folder / "results" / "demo"
    results.mkdir(parents=True)
    shutil.copy(study.source, results / STUDY_COPY)
    (results / "plan.json").write_text(plan_text(study))
    for planned in study.planned_runs():
        told = {key: {"value": value, "unit": ""} for key, value in planned.parameters.items()}
        write_buckling_run(results / "runs" / planned.run_id, int(planned.parameters["seed"]), parameters=told)
    return folder


@pytest.fixture
def workshop(_prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder to work in, with the commands on the path."""
    commands = tmp_path / "bin"
    commands.mkdir()
    for command, module in (("forcechain", "-m harness "), ("python", "")):
        (commands / command).write_text(f'#!/bin/sh\nexec "{sys.executable}" {module}"$@"\n')
        (commands / command).chmod(0o755)
    monkeypatch.setenv("PATH", f"{commands}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    folder = Path(shutil.copytree(_prepared, tmp_path / "work"))
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("page", as_parameters([page for page in PAGES if page != DOCS / "tutorial.md"]))
def test_every_block_runs(page: Path, workshop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_page(page, workshop, capsys)


@pytest.mark.yade
def test_the_tutorial_runs_with_the_real_demo(workshop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(workshop / "results")
    run_page(DOCS / "tutorial.md", workshop, capsys)


def run_page(page: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    namespace: dict[str, object] = {"__name__": "__main__"}
    inside_yade = []
    for block in docs_blocks.blocks_of(page):
        where = f"{name(page)}, line {block.line}"
        if block.not_run:
            check_form(block)
        elif FILE_NAME.fullmatch(block.title):
            (folder / block.title).write_text(block.text)
        elif block.title == INSIDE_YADE:
            inside_yade.append(block.text)
        elif block.language == "python":
            capsys.readouterr()
            docs_blocks.run_python(block, page, namespace)
            expected = docs_blocks.expected_prints(block.text)
            printed = capsys.readouterr().out.splitlines()
            assert not expected or printed == expected, where
        elif block.language == "sh":
            ended = docs_blocks.run_shell(block.text, folder, os.environ)
            assert ended.returncode == 0, f"{where}: {ended.stdout}"
            assert "Traceback" not in ended.stdout, f"{where}: {ended.stdout}"
        elif block.language == "console":
            for command, expected_output in docs_blocks.console_steps(block.text):
                ended = docs_blocks.run_shell(command, folder, os.environ)
                assert ended.returncode == 0, f"{where}: {command}: {ended.stdout}"
                wanted = docs_blocks.pattern(expected_output, any_numbers=name(page) in MEASURED)
                found = docs_blocks.squeezed(ended.stdout)
                assert wanted.fullmatch(found), f"{where}: {command}: expected\n{expected_output}\nfound\n{found}"
        elif block.language == "toml":
            check_toml(block, folder)
        elif block.language == "yaml":
            yaml.safe_load(block.text)
    if inside_yade:
        run_inside_yade("\n".join(inside_yade), folder)


def check_form(block: docs_blocks.Block) -> None:
    """What is not run is at least Python, or a shell's."""
    if block.language == "python":
        compile(block.text, f"line {block.line}", "exec")
    elif block.language == "sh":
        subprocess.run(["bash", "--norc", "-n"], input=block.text, text=True, check=True, capture_output=True)


def check_toml(block: docs_blocks.Block, folder: Path) -> None:
    """A block with a script or a table of parameters is a study; each has to be one that would run."""
    file = folder / f"block{block.line}.toml"
    file.write_text(block.text)
    study = read_study(file)
    read_options(study.analysis, str(file))
    calibrated_ratios(study.compare, str(file))


def run_inside_yade(script: str, folder: Path) -> None:
    found = find_yade()
    assert found is not None
    file = folder / "inside_yade.py"
    file.write_text(script)
    environment = found.environment()
    environment["PYTHONPATH"] = f"{environment.get('PYTHONPATH', '')}:{ROOT}"
    ended = subprocess.run(
        found.invocation(file, []), cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_says_what_it_is(page: Path) -> None:
    for block in docs_blocks.blocks_of(page):
        assert block.language in RUN | READ | SHOWN, f"{name(page)}, line {block.line}: {block.language!r}"


def test_few_blocks_are_not_run_and_each_says_why() -> None:
    found = {(name(page), block.not_run) for page in PAGES for block in docs_blocks.blocks_of(page) if block.not_run}
    assert found == NOT_RUN


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as the site and most viewers of Markdown make them."""
    text = docs_blocks.FENCE.sub("", page.read_text(encoding="utf-8"))
    taken: set[str] = set()
    for heading in re.findall(r"^#+ (.*)$", text, re.M):
        unique(slugify(re.sub(r"[`*]", "", heading), "-"), taken)
    return taken


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_resolve(page: Path) -> None:
    text = docs_blocks.FENCE.sub("", page.read_text(encoding="utf-8"))
    broken = [link for link in LINK.findall(text) if fault(link, page)]
    assert broken == []


def fault(link: str, page: Path) -> bool:
    """Whether a link leads nowhere: to no file, to no heading; elsewhere, only its form is looked at."""
    parts = urlparse(link)
    if parts.scheme:
        return parts.scheme != "https" or "." not in parts.netloc
    target = (page.parent / parts.path).resolve() if parts.path else page
    if not target.exists() or ROOT not in target.parents:
        return True
    if page != ROOT / "README.md" and DOCS not in target.parents:
        return True  # the site has nothing but the pages' folder
    return bool(parts.fragment) and (target.suffix != ".md" or parts.fragment not in anchors(target))


@pytest.mark.parametrize(
    "link",
    [
        "nothing.md",
        "index.md#no-such-heading",
        "../README.md",
        "http://example.org",
        "https://nowhere",
        "images/demo.png#x",
    ],
)
def test_a_bad_link_is_seen(link: str) -> None:
    assert fault(link, DOCS / "index.md")


def test_the_gallery_script_runs_and_comes_to_the_verdict_of_compare(workshop: Path) -> None:
    command = "python examples/from_tables_to_verdict.py results/demo figures && forcechain compare results/demo"
    ended = docs_blocks.run_shell(command, workshop, os.environ)
    assert ended.returncode == 0, ended.stdout
    by_hand = re.search(r"axial force, mean over the drop: model (\S+) N, data (\S+) ± \S+ N: (\w+)", ended.stdout)
    assert by_hand is not None
    row = next(line for line in ended.stdout.splitlines() if line.startswith("axial force, mean over the drop  "))
    assert by_hand[3] in row
    assert f"{float(by_hand[1]):.3g}" in row
    assert all((workshop / "figures" / f"{figure}.png").stat().st_size > 10_000 for figure in ("segments", "force"))


def test_the_site_builds_strictly_and_fetches_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    pages = {page.relative_to(tmp_path / "site").as_posix() for page in (tmp_path / "site").rglob("*.html")}
    assert {f"{name(page).removesuffix('.md')}.html" for page in PAGES if page.parent != ROOT} <= pages
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(
            r"<(?:script|img|iframe|source)[^>]*\ssrc=[\"']?([^\"' >]+)|<link[^>]*\shref=[\"']?([^\"' >]+)", text
        )
        assert [link for pair in fetched for link in pair if urlparse(link).netloc] == [], page.name
    told = (tmp_path / "site" / "commands.html").read_text(encoding="utf-8")
    assert "forcechain approve" in told
    assert "particle_count" in (tmp_path / "site" / "study-files.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "fails"),
    [
        ("```sh\nfalse\n```\n", True),
        ("```sh\ntrue\n```\n", False),
        ("```sh\nforcechain status nowhere\n```\n", True),
        ("```console\n$ echo a\nb\n```\n", True),
        ("```console\n$ echo a\na\n```\n", False),
        ("```python\nprint(1 + 1)  # 3\n```\n", True),
        ("```python\nprint(1 + 1)  # 2\n```\n", False),
        ("```toml\n[parameters]\nfrction = 0.5\n```\n", True),
    ],
)
def test_a_block_that_is_not_true_is_seen(
    text: str, fails: bool, workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = workshop / "page.md"
    page.write_text(text)
    if fails:
        with pytest.raises((AssertionError, InputError)):
            run_page(page, workshop, capsys)
    else:
        run_page(page, workshop, capsys)
