"""Names come from files that others wrote: no writer turns one into a path, code, a formula or markup."""

import ast
import csv
import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from falsifier.campaigns.analysis import load, read_published
from falsifier.campaigns.archcomp import export as arch_comp
from falsifier.campaigns.request import run_name
from falsifier.campaigns.tables import TABLES
from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name
from falsifier.core.literals import one_line
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.counterexamples.regression import Database
from falsifier.counterexamples.store import file_of, to_store
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import parse_spec
from falsifier.problem.writing import starter_spec
from falsifier.record.run import falsify
from falsifier.search.request import RunRequest
from falsifier.search.result import Result
from falsifier.stl import parse
from falsifier.stl.lexer import name_text
from falsifier.testing import lag_problem
from falsifier.views.report import html_report, markdown_report
from falsifier.views.text import result_json, result_text, results_text
from tests.counterexamples.export.support import exported
from tests.hostile.names import HOSTILE, names
from tests.pages import parse as parse_page

PLAIN = "plain"
# Those of one line without control characters; a requirement may not have any other name.
TITLES = tuple(name for name in HOSTILE if one_line(name) == name)
hostile = pytest.mark.parametrize("name", TITLES, ids=range(len(TITLES)))


# -- one function per language ----------------------------------------------------------------------------


@given(names)
def test_file_names_are_one_component(name: str) -> None:
    made = file_name(name)
    assert made not in ("", ".", "..") and len(made.encode()) < 200
    assert Path(made).name == made and not re.search(r'[\\/:*?"<>|\0-\x1f]', made)
    assert not made.startswith("-")
    assert file_name(made) == made or made != name


@given(st.lists(names, unique=True))
def test_different_names_are_different_files(several: list[str]) -> None:
    assert len({file_name(name) for name in several}) == len(several)


@given(names)
def test_formulas_name_signals_of_any_name(name: str) -> None:
    if not name or "\0" in name:
        return
    assert set(parse(f"{name_text(name)} <= 1").signals) == {name}


# -- what a run writes ------------------------------------------------------------------------------------


def named(name: str, stl: str = "G[0,10] (x <= 0.9)") -> Problem:
    return lag_problem(stl, name=name)


def written(directory: Path) -> set[str]:
    return {p.relative_to(directory).as_posix() for p in directory.rglob("*")}


@pytest.mark.parametrize("name", sorted({*HOSTILE} - {*TITLES}))
def test_a_name_that_would_split_messages_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="expected a name of one line") as caught:
        named(name)
    assert one_line(str(caught.value)) == str(caught.value)
    if "\ud800" in name:  # no file can contain it
        return
    for section in ("requirements", "profiles"):
        content = {"requirements": {"R": {"formula": "x > 0"}}}
        content.setdefault(section, {})[name] = {"formula": "x > 0"} if section == "requirements" else {}
        with pytest.raises(SpecError, match=f"a.toml: {section}..*expected a name of one line") as caught:
            parse_spec({"model": {"fmu": "a.fmu"}, **content}, file="a.toml")
        assert one_line(str(caught.value)) == str(caught.value)


@hostile
def test_runs_stay_in_their_directory(name: str, tmp_path: Path) -> None:
    place = tmp_path / "here" / "out"
    other = replace(named("other"), experiment=replace(named("other").experiment, tolerance=1e-3))
    several = falsify([named(name), other], "corners", budget=1, directory=place)
    assert written(tmp_path / "here").isdisjoint(HOSTILE)
    assert {p.name for p in tmp_path.iterdir()} == {"here"}
    assert {p.name for p in (tmp_path / "here").iterdir()} == {"out"}
    assert all(r.directory is not None and r.directory.parent == place for r in several)
    found = several[0].counterexample
    assert found is not None
    stored = Database(place / "store").save(named(name), to_store(found))
    assert stored.parent.parent == place / "store"
    assert Path(file_of(name, shared=True)).name == file_of(name, shared=True)
    source = ProblemSource(target=f"specs/AT.toml:{name}")
    assert Path(run_name(RunRequest(problems=(source,)))).name == run_name(RunRequest(problems=(source,)))


def recorded(name: str, directory: Path) -> Result:
    return falsify(named(name), "corners", budget=3, directory=directory)


def tags(page: str) -> list[tuple[str, tuple[str, ...]]]:
    """Elements and the names of their attributes, in order."""
    return [(element.tag, tuple(element.attrib)) for element in parse_page(page).iter()]


def form(directory: Path, result: Result) -> list[object]:
    """What reports of a run have beside its names: elements of pages, numbers of lines."""
    tables = [make(load(directory), read_published()) for make in TABLES.values()]
    texts = [text for table in tables for text in (table.text(), table.markdown())]
    texts += [markdown_report(directory), result_text(replace(result, directory=None))]
    return [tags(html_report(directory)), *(len(text.splitlines()) for text in texts)]


@pytest.fixture(scope="module")
def plain_form(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[object]]:
    """Of a run without a hostile name; pictures have no ticks, which take most time and contain no names."""
    directory = tmp_path_factory.mktemp("plain") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.axis.Axis._update_ticks", lambda axis: [])
        yield form(directory, recorded(PLAIN, directory))


@hostile
def test_reports_show_names_as_text(name: str, tmp_path: Path, plain_form: list[object]) -> None:
    if "\ud800" in name:
        pytest.skip("no spec file can contain it")
    directory = tmp_path / "run"
    result = recorded(name, directory)
    assert form(directory, result) == plain_form
    for make in TABLES.values():
        table = make(load(directory), read_published())
        cells = [cell for row in csv.reader(table.csv().splitlines()) for cell in row]
        assert not [cell for cell in cells if re.match(r"[=+@]|-[^\d.]", cell)]
    (exported,) = arch_comp(load(directory)).values()
    rows = list(csv.reader(exported.splitlines()))
    assert len(rows) == 2 and not re.match("[=+@]", rows[1][1])
    for text in (result_text(result), results_text([result, result])):
        assert not re.search("[\0-\x08\x0b-\x1f\x7f]", text)
    assert json.loads(json.dumps(result_json(result)))["requirement"] == name


# -- scripts for other tools ------------------------------------------------------------------------------


def shape(script: str) -> list[str]:
    """A Python script without the content of its strings."""
    tree = ast.parse(script)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree).split()


def statements(script: str) -> str:
    """An OpenModelica script without comments and the content of its strings."""
    lines = [line for line in script.splitlines() if not line.startswith("//")]
    return re.sub(r'"(?:[^"\\]|\\.)*"', '""', "\n".join(lines))


@pytest.fixture(scope="module")
def transmission() -> Iterator[tuple[Problem, Evaluation]]:
    problem = load_problem("AT1")
    inputs = {"throttle": Signal((0.0,), (100.0,)), "brake": Signal((0.0,), (0.0,))}
    yield problem, evaluate(problem, Candidate(inputs))
    problem.model.close()


def scripts_of(name: str, given: tuple[Problem, Evaluation], directory: Path) -> dict[str, str]:
    problem = replace(given[0], requirement=replace(given[0].requirement, name=name))
    files = exported(problem, given[1], directory)
    assert {p.parent for p in files} == {directory}
    return {p.name: p.read_text(encoding="utf-8") for p in files if p.suffix in (".py", ".mos")}


@pytest.mark.parametrize("name", TITLES)
def test_exported_scripts_contain_names_as_text(
    name: str, transmission: tuple[Problem, Evaluation], tmp_path: Path
) -> None:
    scripts = scripts_of(name, transmission, tmp_path / "hostile")
    plain = scripts_of(PLAIN, transmission, tmp_path / "plain")
    assert scripts.keys() == plain.keys() == {"replay.py", "replay.mos"}
    for ours, theirs in zip(sorted(scripts.items()), sorted(plain.items()), strict=True):
        if ours[0].endswith(".py"):
            assert shape(ours[1]) == shape(theirs[1])
        else:
            assert statements(ours[1]) == statements(theirs[1])


@given(names, names, names)
def test_starter_specs_of_any_fmu_are_toml(name: str, text: str, unit: str) -> None:
    if not name or re.search("[\0\ud800-\udfff]", name):
        return
    variables = (
        Variable(name, causality="input", unit=unit, description=text),
        Variable(f"{name}y", causality="output", description=text),
        Variable(f"{name}p", causality="parameter", start=1.0, unit=unit, settable=True),
    )
    info = ModelInfo(name, text, variables=variables, interfaces=("co-simulation",))
    spec = tomllib.loads(starter_spec(Path("some.fmu"), info))
    assert set(spec["inputs"]) == {name}
    assert set(spec) <= {"model", "inputs", "parameters", "requirements"}


@given(names.map(lambda name: name.encode(errors="ignore").decode().replace("\0", "")))  # others are refused
def test_shell_commands_are_one_word_per_argument(name: str) -> None:
    from falsifier.views.report.wording import run_command

    request = RunRequest(problems=(ProblemSource(target=f"AT.toml:{name}"),))
    assert f"AT.toml:{name}" in shlex.split(run_command(request))
