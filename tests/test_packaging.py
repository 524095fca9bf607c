"""What is built from this checkout: a wheel and an sdist that hold what a user needs, and run elsewhere."""

import json
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from tests.command import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = ROOT / "Dockerfile"
_LANGUAGE = "Programming Language :: Python :: "
VERSIONS = [c.removeprefix(_LANGUAGE) for c in PROJECT["classifiers"] if c.startswith(_LANGUAGE)]


def build(source: Path, target: Path, kind: str) -> Path:
    """Build without a network: with the hatchling that is installed."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(target)]
    subprocess.run(command, cwd=source, check=True, capture_output=True, timeout=120)
    (built,) = target.iterdir()
    return built


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("sdist"), "sdist")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, tmp_path_factory.mktemp("wheel"), "wheel")


@pytest.fixture(scope="module")
def wheel_of_the_sdist(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (source,) = folder.iterdir()
    return build(source, tmp_path_factory.mktemp("again"), "wheel")


def contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_wheel_holds_the_licence_the_types_and_every_bundled_problem(wheel: Path) -> None:
    files = contents(wheel)
    bundled = [p for folder in ("specs", "fmus") for p in (ROOT / folder).iterdir()]
    assert len(bundled) > 10
    for path in bundled:
        assert files[f"falsifier/{path.relative_to(ROOT)}"] == path.read_bytes()
    worker = ROOT / "falsifier" / "fmu" / "worker"
    programs = [path for path in worker.rglob("*") if path.is_file()]
    assert len([path for path in programs if path.parent.parent.name == "bin"]) == 5
    for path in programs:
        assert files[str(path.relative_to(ROOT))] == path.read_bytes()
    assert "falsifier/py.typed" in files and "pytest_falsifier.py" in files
    (metadata,) = (Parser().parsestr(files[n].decode()) for n in files if n.endswith(".dist-info/METADATA"))
    assert metadata["License-Expression"] == PROJECT["license"] == "Apache-2.0"
    (licence,) = (files[name] for name in files if name.endswith("licenses/LICENSE"))
    assert licence == (ROOT / "LICENSE").read_bytes()
    tops = {name.split("/")[0] for name in files if ".dist-info" not in name}
    assert tops == {"falsifier", "pytest_falsifier.py"}


def test_the_sdist_makes_the_same_wheel(wheel: Path, wheel_of_the_sdist: Path) -> None:
    one, other = contents(wheel), contents(wheel_of_the_sdist)
    assert one.keys() == other.keys()
    assert [name for name in one if one[name] != other[name]] == []


def test_the_sdist_holds_the_tests_and_nothing_that_git_ignores(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/test_packaging.py", "docs/index.md", "mkdocs.yml", "LICENSE", "Makefile"} <= names
    assert not [name for name in names if "__pycache__" in name or ".venv" in name]


def test_an_installed_sdist_falsifies_a_bundled_problem_anywhere(
    wheel_of_the_sdist: Path, tmp_path: Path
) -> None:
    """Its wheel alone in a new environment, which finds the dependencies where these tests do."""
    venv.create(tmp_path / "env")
    python = str(tmp_path / "env" / "bin" / "python")
    pip = [sys.executable, "-m", "pip", "--python", python]  # faster than one of its own
    install = [*pip, "install", "--no-compile", "--no-index", "--no-deps", "-q", str(wheel_of_the_sdist)]
    subprocess.run(install, check=True, capture_output=True, timeout=120)
    (site,) = (tmp_path / "env" / "lib").glob("python*/site-packages")
    # Paths in a .pth file bring their packages, but no .pth files of their own: not this checkout.
    dependencies = [p for p in sys.path if p.endswith("site-packages")]
    (site / "dependencies.pth").write_text("\n".join(dependencies))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    done = subprocess.run(
        [tmp_path / "env" / "bin" / "falsifier", "run", "AT1", "--out", "run"],
        cwd=elsewhere,
        env={"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert "AT1: falsified" in done.stdout
    used = [
        Path(path).resolve()
        for path in json.loads((elsewhere / "run" / "manifest.json").read_text())["hashes"]
    ]
    assert used == [site / "falsifier" / "fmus" / "AT.fmu", site / "falsifier" / "specs" / "AT.toml"]


def test_the_image_copies_what_exists_and_runs_as_a_user() -> None:
    lines = [line for line in RECIPE.read_text(encoding="utf-8").splitlines() if line and line[0] != "#"]
    words = [line.split() for line in "\n".join(lines).replace("\\\n", " ").splitlines()]
    copied = [path for first, *rest in words if first == "COPY" for path in rest[:-1] if path[:2] != "--"]
    assert {"pyproject.toml", "README.md", "LICENSE", "falsifier", "specs", "fmus"} <= set(copied)
    for path in copied:
        assert (ROOT / path).exists(), path
    users = [rest[0] for first, *rest in words if first == "USER"]
    assert users and users[-1] not in ("root", "0")
    assert ["ENTRYPOINT", '["falsifier"]'] in words
    (image,) = (rest[0] for first, *rest in words if first == "FROM")
    version = re.fullmatch(r"python:(\d\.\d+)-slim", image)
    assert version and version[1] in VERSIONS
