"""The documentation: it builds strictly, and what it says of keys, commands, names and numbers is true."""

import ast
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from inspect import getmembers, isclass
from pathlib import Path
from runpy import run_path
from typing import Any

import click
import pytest

import falsifier
from falsifier import errors
from falsifier.cli import cli
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.llm import DEFAULT_VARIANT
from falsifier.llm.prompts import VARIANTS
from falsifier.problem.spec import Spec, parse_spec
from falsifier.problem.templates import TEMPLATES
from tests.command import ROOT, commands, forked

WRITTEN = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "design").glob("*.md")),
]
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")


def blocks(path: Path, *languages: str) -> list[str]:
    found = FENCE.findall(path.read_text(encoding="utf-8"))
    return [text for language, text in found if language in languages]


def prose(path: Path) -> str:
    return FENCE.sub("", path.read_text(encoding="utf-8"))


# -- the site --------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """A built page: its text, its anchors, and what a browser loads for it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.text = ""
        self.anchors: set[str] = set()
        self.loaded: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors.add(values.get("id") or "")
        if tag in ("script", "img", "link", "iframe", "source"):
            self.loaded.add(values.get("src") or values.get("href") or "")

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Page]:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.relative_to(folder).as_posix(): Page(path) for path in folder.rglob("*.html")}


def test_no_page_loads_anything_from_another_server(site: dict[str, Page]) -> None:
    assert len(site) > 20
    loaded = {address for page in site.values() for address in page.loaded}
    assert [address for address in loaded if re.match(r"(https?:)?//", address)] == []


def test_the_spec_page_has_every_key_of_every_section(site: dict[str, Page]) -> None:
    schema = Spec.model_json_schema()
    pages = site["spec/index.html"], site["systems/index.html"], site["requirements/index.html"]
    text = "".join(page.text for page in pages)
    anchors = set().union(*(page.anchors for page in pages))
    for section in schema["$defs"].values():
        for key in section["properties"]:
            assert re.search(rf"\b{key}\b", text), key
    for key in schema["properties"]:
        assert any(anchor.startswith(key) for anchor in anchors), key


def test_marks_are_replaced_by_tables(site: dict[str, Page]) -> None:
    marked = [path for path in WRITTEN if re.search(r"^<!-- \w+", path.read_text(), re.MULTILINE)]
    assert {path.stem for path in marked} == {
        "spec", "systems", "requirements", "commands", "engines", "language-models", "json"
    }  # fmt: skip
    engines, llms = site["engines/index.html"].text, site["language-models/index.html"].text
    listed = (ROOT / "README.md").read_text(encoding="utf-8")
    for name, engine in ENGINES.items():
        assert name in engines and engine.summary in engines and f"`{name}`" in listed, name
    assert [name for name in VARIANTS if name not in llms] == []
    assert f"{DEFAULT_ENGINE} (default)" in engines and f"{DEFAULT_VARIANT} (default)" in llms


def test_every_command_that_prints_json_has_a_table_of_its_keys() -> None:
    tables = run_path(str(ROOT / "docs" / "scripts" / "json_keys.py"))["_COMMANDS"].values()
    printing = [name for name, command in commands(cli) if any("--json" in p.opts for p in command.params)]
    assert {n for n in printing if not any(t.startswith(f"{n} ") for t in tables)} == {"resume", "bench"}


def test_the_command_page_has_every_command_and_option(site: dict[str, Page]) -> None:
    text = site["commands/index.html"].text
    found = dict(commands(cli))
    assert {"run", "llm check"} <= found.keys()
    for name, command in found.items():
        assert f"falsifier {name} " in text
        for option in (o for p in command.params if isinstance(p, click.Option) for o in p.opts):
            assert option in text, f"{name} {option}"


def test_every_public_name_is_on_an_api_page(site: dict[str, Page]) -> None:
    anchors = {anchor for name, page in site.items() if name.startswith("api/") for anchor in page.anchors}
    public = {f"falsifier.{name}" for name in dir(falsifier) if name != "__version__"}
    assert public <= anchors
    raised = [name for name, value in getmembers(errors, isclass) if issubclass(value, Exception)]
    assert {f"falsifier.errors.{name}" for name in raised if name != "FalsifierError"} <= anchors


def test_the_pictures_of_templates_are_what_they_say() -> None:
    found = run_path(str(ROOT / "docs" / "scripts" / "template_pictures.py"))["robustness"]()
    assert found.keys() == set(TEMPLATES)
    assert [name for name, (good, bad) in found.items() if not good > 0 > bad] == []


# -- examples --------------------------------------------------------------------------------------------


def written_commands() -> Iterator[tuple[str, str]]:
    for path in WRITTEN:
        lines = [line for text in blocks(path, "", "sh", "console") for line in whole_lines(text)]
        lines += INLINE.findall(prose(path))
        for line in lines:
            if line.startswith("falsifier ") and not line.startswith("falsifier COMMAND"):
                yield path.name, line


def whole_lines(text: str) -> list[str]:
    return [line.removeprefix("$ ").strip() for line in text.replace("\\\n", " ").splitlines()]


def test_every_command_that_is_written_exists_with_its_options() -> None:
    found = dict(commands(cli))
    checked = 0
    for page, line in written_commands():
        words = shlex.split(line, comments=True)[1:]
        if words[0].startswith("-"):
            continue
        name = next((n for n in (" ".join(words[:2]), words[0]) if n in found), None)
        assert name is not None, f"{page}: {line}"
        known = {o for p in found[name].params for o in p.opts} | {"--help"}
        unknown = [word for word in words if re.match(r"--?[a-z]", word) and word not in known]
        assert not unknown, f"{page}: {line}: {unknown}"
        checked += 1
    assert checked > 60


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_specs_in_examples_are_valid(path: Path) -> None:
    for text in blocks(path, "toml"):
        spec = parse_spec(tomllib.loads(text), file=str(path))
        assert spec.requirements


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_names_that_examples_import_are_public(path: Path) -> None:
    for text in blocks(path, "python"):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.module == "falsifier":
                assert {alias.name for alias in node.names} <= set(dir(falsifier)), text


def test_the_tutorial_prints_what_it_shows() -> None:
    """Its commands, one after the other, in an empty folder."""
    consoles = run_path(str(ROOT / "docs" / "scripts" / "consoles.py"))

    def execute(command: str, folder: Path, environment: Mapping[str, str]) -> Any:
        """Execute a command, in a copy of a process that has imported what falsifier does."""
        words = shlex.split(command.replace("\\\n", " "))
        plain = words[0] == "falsifier" and not set(command) & set("|&;<>$`*?~")
        return (forked if plain else consoles["in_shell"])(words if plain else command, folder, environment)

    tutorial = ROOT / "docs" / "tutorial.md"
    _, differences = consoles["run"](tutorial.read_text(encoding="utf-8"), execute)
    assert differences == [], "if this is meant: python docs/scripts/consoles.py docs/tutorial.md"


# -- facts -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files(path: Path) -> None:
    generated = {ROOT / "docs" / name for name in ("changelog.md", "contributing.md")}
    generated |= {ROOT / "docs" / "design" / p.name for p in (ROOT / "design").glob("*.md")}
    targets = [t for t in LINK.findall(prose(path)) if not t.startswith("http")]
    missing = [
        t for t in targets if not (place := (path.parent / t).resolve()).exists() and place not in generated
    ]
    assert not missing


def test_paths_that_contributors_are_told_exist() -> None:
    told = re.findall(r"`((?:[\w.-]+/)+[\w.-]*)`", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    paths = [path for path in told if "NAME" not in path and not path.startswith("build/")]
    assert len(paths) > 15
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_the_layout_note_names_every_room_in_order() -> None:
    note = (ROOT / "design" / "layout.md").read_text(encoding="utf-8")
    listed = re.findall(r"^  ([a-z]+)/ ", note, re.MULTILINE)
    assert listed == re.findall(r"^    ([a-z]+)/ ", falsifier.__doc__ or "", re.MULTILINE)
    for room in ("core", "problem", "search"):
        (line,) = re.findall(rf"^  {room}/ +(.+)$", note, re.MULTILINE)
        assert set(line.split()) == {p.stem for p in (ROOT / "falsifier" / room).glob("[a-z]*.py")}


def table_rows(text: str) -> dict[str, list[str]]:
    """Cells of a Markdown table's rows by their first cell."""
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| ")
    ]
    return {cells[0]: cells for cells in rows if cells[0] not in ("requirement", "")}


def test_the_headline_numbers_are_those_of_the_benchmark() -> None:
    sections = (ROOT / "bench" / "search.md").read_text(encoding="utf-8").split("\n## ")
    free, other_seeds = (table_rows(section) for section in sections[1:3])
    assert "300-309" in sections[2]
    readme = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Measured")[2]
    shown = table_rows(readme.partition("F16 needs")[0])
    assert shown.keys() == free.keys() == other_seeds.keys()

    def told(row: list[str]) -> str:
        return row[4] if row[3] == "10/10" else row[3]

    for name, cells in shown.items():
        best = free[name][1].removeprefix("10: ")
        assert cells[1:] == [best, told(free[name]), told(other_seeds[name])], name
