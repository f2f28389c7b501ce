"""The wheel, installed where there is no checkout: everything a user does there works."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import forcechain

ROOT = Path(__file__).parents[1]
PACKAGES = ("forcechain", "harness", "yade_scripts")
NOT_SOURCES = (
    ".git",
    ".venv",
    "build",
    "dist",
    "site",
    "results",
    "*.egg-info",
    "__pycache__",
    ".*_cache",
    ".hypothesis",
)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source archive, and the wheel that is built from it: nothing reaches it from the checkout."""
    folder = tmp_path_factory.mktemp("built")
    source = shutil.copytree(ROOT, folder / "source", ignore=shutil.ignore_patterns(*NOT_SOURCES))
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder / "dist"), str(source)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return folder / "dist"


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel; the libraries it needs are borrowed from this one, to need no network."""
    folder = tmp_path_factory.mktemp("fresh") / "venv"
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    (wheel,) = built.glob("*.whl")
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*command, str(wheel)], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    # A line of a .pth file is a folder: its own .pth files, and with them this checkout, stay out
    (packages / "borrowed.pth").write_text(f"{sysconfig.get_paths()['purelib']}\n")
    return folder / "bin"


def call(installed: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [str(installed / "forcechain"), *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def files_of(built: Path, folder: str) -> list[str]:
    """Every file of a folder of the checkout that was built."""
    source = built.parent / "source"
    return [file.relative_to(source).as_posix() for file in (source / folder).rglob("*") if file.is_file()]


def test_every_module_and_data_file_is_in_the_wheel(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    for package in PACKAGES:
        missing = [file for file in files_of(built, package) if file not in names]
        assert missing == []
    missing = [file for file in files_of(built, "studies") if f"harness/{file}" not in names]
    assert missing == []
    missing = [
        file for file in files_of(built, "reference") if file.replace("reference", "harness/results", 1) not in names
    ]
    assert missing == []


def test_the_source_archive_is_the_checkout(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    assert {"README.md", "CHANGELOG.md", "LICENSE", "run", "mkdocs.yml", "constraints.txt"} <= names
    for folder in ("docs", "baselines", "tests", "studies", "benchmarks", "reference"):
        missing = [file for file in files_of(built, folder) if file not in names]
        assert missing == []


def test_the_version_stands_in_one_place(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    assert f"-{forcechain.__version__}-" in wheel.name
    told = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "version" not in told["project"]
    assert forcechain.__version__ in (ROOT / "CHANGELOG.md").read_text()


def test_what_runs_is_the_wheel(installed: Path, tmp_path: Path) -> None:
    where = (
        "import harness, forcechain, yade_scripts; print(harness.__file__, forcechain.__file__, yade_scripts.__file__)"
    )
    told = subprocess.run(
        [str(installed / "python"), "-I", "-c", where], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for file in told.stdout.split():
        assert Path(file).is_relative_to(installed.parent)


def test_it_works_without_yade(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(installed))
    monkeypatch.delenv("YADE_COMMAND", raising=False)
    told = call(installed, tmp_path, "--version")
    assert (told.returncode, told.stdout) == (0, f"forcechain {forcechain.__version__}, YADE not found\n")
    told = call(installed, tmp_path, "model", "--angles", "14")
    assert told.returncode == 0
    assert told.stdout.splitlines()[1].startswith("14.0,2,9.27")
    assert call(installed, tmp_path, "doctor").returncode == 3
    told = call(installed, tmp_path, "demo")
    assert told.returncode == 3
    assert told.stderr.startswith("forcechain: YADE is not found; install it")


@pytest.mark.yade
def test_a_new_user_gets_from_doctor_to_the_gate(installed: Path, tmp_path: Path) -> None:
    """A study copied, one parameter changed, run, compared, reported, approved, checked: as in the tutorial."""
    assert call(installed, tmp_path, "doctor").returncode == 0
    printed = call(installed, tmp_path, "studies", "demo")
    changed = printed.stdout.replace('name = "demo"', 'name = "mine"').replace(
        "rolling_friction = 0.2", "rolling_friction = 0.05"
    )
    assert changed != printed.stdout
    small = changed.replace("particle_count = 600", "particle_count = 150").replace("strain = 0.1", "strain = 0.04")
    (tmp_path / "mine.toml").write_text(small)
    run = call(installed, tmp_path, "run", "mine.toml")
    assert run.returncode == 0, run.stderr
    compared = call(installed, tmp_path, "compare", "results/mine", "--json")
    assert compared.returncode in (0, 1), compared.stderr
    assert json.loads(compared.stdout)["rows"]
    assert call(installed, tmp_path, "report", "results/mine").returncode == 0
    assert (tmp_path / "results" / "mine" / "report.html").stat().st_size > 10_000
    approved = call(installed, tmp_path, "approve", "results/mine", "--baseline", "approved.toml", "--reason", "a test")
    assert approved.returncode == 0, approved.stderr
    assert call(installed, tmp_path, "check", "results/mine", "--baseline", "approved.toml").returncode == 0


@pytest.mark.yade
def test_a_script_of_ones_own_sees_yades_packages_first(installed: Path, tmp_path: Path) -> None:
    """The environment's packages may be of another Python: inside YADE they come last, if at all."""
    (tmp_path / "mine.py").write_text(
        "import sys\n"
        "import json, numpy, yade\n"
        "from pathlib import Path\n"
        "from yade_scripts import export\n"
        "told = {'path': sys.path, 'export': export.__file__, 'arguments': sys.argv[1:]}\n"
        "Path(sys.argv[sys.argv.index('--folder') + 1], 'told.json').write_text(json.dumps(told))\n"
    )
    (tmp_path / "mine.toml").write_text('name = "mine"\nscript = "mine.py"\n')
    assert call(installed, tmp_path, "run", "mine.toml").returncode == 3  # it writes no manifest
    (file,) = tmp_path.glob("results/mine/**/told.json")
    told = json.loads(file.read_text())
    assert Path(told["export"]).is_relative_to(installed.parent)
    ours = [place for place, folder in enumerate(told["path"]) if Path(folder).is_relative_to(installed.parent)]
    assert ours == [len(told["path"]) - 1]
    assert told["arguments"][0].endswith("parameters.json")
