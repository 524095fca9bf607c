"""Requirements as pytest tests: ``pytest --falsifier specs/`` collects every requirement of every spec file.

Stored counterexamples are replayed first, then a search within a budget looks for a new one. Ordinary tests
use the fixture ``falsifier_check``. This module is outside the package, because pytest imports its plugins at
every start and the package takes time to import.
"""

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from falsifier.counterexamples.regression import Checked, Database
    from falsifier.problem.problem import Problem

_DEFAULT_BUDGET = 100
_DEFAULT_DATABASE = "counterexamples"
_OPTIONS = ("budget", "engine", "seed", "strict", "database")
_NUMBERS = {"budget": (1, 10_000_000), "seed": (0, 2**63)}
# Files of other tools, whatever they contain.
_FOREIGN = frozenset(
    f"{name}.toml"
    for name in (
        *("pyproject", "pytest", ".pytest", "tox", "ruff", ".ruff", "uv", "pixi", "hatch", "poetry"),
        *("Cargo", "Project", "Manifest", "JuliaProject", "JuliaManifest", "netlify"),
    )
)
# What may be keys and tables of a file that is no valid TOML.
_WORDS = re.compile(r"^[\s\[]*[\"']?([\w-]+)", re.MULTILINE)
# How similar a key must be to the name of a table to be a misspelling of it: modle is.
_NEAR = 0.8


class RequirementWarning(UserWarning):
    """Base of all warnings of this plugin."""


class UntestedWarning(RequirementWarning):
    """A requirement was not falsified, but a part of it was not tested, or simulations failed."""


class UnconfirmedWarning(RequirementWarning):
    """A requirement was violated, but no violation was confirmed."""


class UncollectedWarning(RequirementWarning):
    """A TOML file may be meant as a spec and is not collected."""


class UnusedCounterexampleWarning(RequirementWarning):
    """A stored counterexample tests nothing any more."""


class UntestedError(AssertionError):
    """One of these two where that is an error; reported by its message alone."""


class FalsifiedError(AssertionError):
    """A requirement is violated; reported by its message alone, without a traceback."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and their ini keys."""
    group = parser.getgroup("falsifier", "requirements of FMUs")
    group.addoption(
        "--falsifier", action="store_true", help="collect the requirements in spec files (.toml) as tests"
    )
    group.addoption(
        "--falsifier-budget",
        metavar="N",
        type=int,
        help=f"maximum number of simulations per requirement (default: {_DEFAULT_BUDGET})",
    )
    group.addoption(
        "--falsifier-engine", metavar="NAME", help="search engine (default: as for falsifier run)"
    )
    group.addoption("--falsifier-seed", metavar="N", type=int, help="random seed (default: 0)")
    group.addoption(
        "--falsifier-database",
        metavar="DIR",
        help=f"folder of stored counterexamples, relative to rootdir (default: {_DEFAULT_DATABASE})",
    )
    group.addoption(
        "--falsifier-strict",
        action="store_true",
        default=None,
        help="fail if a part of a requirement was not tested, such as a condition that never held, if "
        "simulations failed, or if a violation was found and not confirmed",
    )
    for name in _OPTIONS:
        kind: Any = "bool" if name == "strict" else None
        parser.addini(f"falsifier_{name}", f"same as --falsifier-{name}", type=kind)


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and check the ini file.

    Raises:
        pytest.UsageError: naming the key that is wrong.
    """
    names = "=, ".join(_OPTIONS)
    config.addinivalue_line(
        "markers", f"falsifier({names}=): how to check a requirement; set on all collected requirements"
    )
    for name in _OPTIONS:
        _setting(config, name)
    if config.getoption("falsifier") and (engine := _setting(config, "engine")):
        from falsifier.errors import SpecError

        try:
            _check_engine(engine)
        except SpecError as error:
            raise pytest.UsageError(f"falsifier_{error}") from None


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect spec files if --falsifier is given; TOML files of other tools are left to other plugins.

    What is given by its name is meant as a spec; of other files, what has requirements.
    """
    if not parent.config.getoption("falsifier") or file_path.suffix != ".toml":
        return None
    if not parent.session.isinitpath(file_path):
        # pytest also looks at the neighbours of a file that is given.
        is_asked_for = any(map(parent.session.isinitpath, file_path.parents))
        if file_path.name in _FOREIGN or not is_asked_for:
            return None
        tables, fault = _tables(file_path)
        if "requirements" not in tables:
            if tables or fault:
                why = fault or f"it has tables of a spec ({', '.join(tables)}), but no [requirements.NAME]"
                text = (
                    f"{_short(file_path)} is not collected: {why}. If it is a spec, correct it; if not, "
                    f"--ignore={_short(file_path)} leaves it out"
                )
                _warn_of_collection(parent.session, UncollectedWarning, file_path, text)
            return None
    return SpecFile.from_parent(parent, path=file_path)


def _tables(file: Path) -> tuple[list[str], str]:
    """Return which tables of a spec a TOML file has, also misspelt, and why it cannot be read, if so."""
    import tomllib
    from difflib import get_close_matches

    from falsifier.core.literals import one_line
    from falsifier.problem.spec import Spec

    content, fault, hollow = b"", "", set[str]()
    try:
        content = file.read_bytes()
        data = tomllib.loads(content.decode("utf-8-sig"))
        keys = [key for key, value in data.items() if isinstance(value, dict)]
        # As packages are listed: requirements of a spec are tables of their own.
        hollow = {k for k in keys if data[k] and not any(isinstance(v, dict) for v in data[k].values())}
    # ValueError: also not UTF-8, and integers of any length; RecursionError: nested without end.
    except (OSError, ValueError, RecursionError) as error:
        fault = one_line(f"it cannot be read as TOML ({error})")
        keys = _WORDS.findall(content.decode("utf-8-sig", "replace"))
    known = list(Spec.model_fields)
    found = []
    for key in dict.fromkeys(keys):
        for name in get_close_matches(key.lower(), known, 1, _NEAR):
            found.append(f"{key} of values" if name == "requirements" and key in hollow else name)
    return found, fault


def pytest_collection_finish(session: pytest.Session) -> None:
    """Warn of stored counterexamples that are never replayed, because their requirement has another name."""
    if not session.config.getoption("falsifier"):
        return
    from falsifier.core.files import file_name
    from falsifier.counterexamples.regression import Database
    from falsifier.errors import SpecError
    from falsifier.problem.spec import read_spec

    folder = _database(session.config, None)
    for place in sorted(path for path in folder.rglob("*.toml") if path.is_dir()):
        spec = Database(folder).spec_of(place)
        try:
            read = {file_name(name) for name in read_spec(spec).requirements} if spec.is_file() else set()
        except SpecError:  # which the collection of this spec tells
            continue
        for path in sorted(place.glob("*/*.json")):
            name = path.parent.name
            if name in read or _is_of_a_test(path):
                continue
            said, now = f"has no requirement {name!r}", place / "NEW-NAME"
            if not spec.is_file():
                said, now = "does not exist", folder / "PATH" / "OF" / "SPEC.toml" / name
            text = (
                f"{_short(path)} is not replayed, because {_short(spec)} {said}. If it was renamed or moved, "
                f"move the file to {_short(now)}; otherwise delete it"
            )
            _warn_of_collection(session, UnusedCounterexampleWarning, path, text)


def _is_of_a_test(file: Path) -> bool:
    """Whether a counterexample is of a requirement that an ordinary test may state of a spec's model."""
    from falsifier.counterexamples.store import load_counterexample
    from falsifier.errors import SpecError

    try:
        source = load_counterexample(file).problem
    except SpecError:
        return False
    return source is None or source.stl is not None


def _warn_of_collection(
    session: pytest.Session, kind: type[RequirementWarning], file: Path, text: str
) -> None:
    """Warn while tests are collected; where warnings are errors, it is an error of the collection.

    An exception would end pytest, with a traceback through it and without running any test.
    """
    try:
        _warn(kind, file, text)
    except kind as error:
        report = pytest.CollectReport(str(_short(file)), "failed", str(error), [])
        session.ihook.pytest_collectreport(report=report)


def _warn(kind: type[RequirementWarning], file: Path, text: str, line: int = 1) -> None:
    __tracebackhide__ = True
    from falsifier.core.literals import printable

    warnings.warn_explicit(printable(text), kind, filename=printable(str(file)), lineno=line)


class SpecFile(pytest.File):
    """A spec file; its requirements are the tests."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield one item per requirement."""
        from falsifier.core.literals import one_line
        from falsifier.errors import SpecError
        from falsifier.problem.spec import read_spec

        try:
            spec = read_spec(self.path)
        except SpecError as error:
            raise self.CollectError(one_line(str(error))) from None
        for name in spec.requirements:
            item = RequirementItem.from_parent(self, name=name, requirement=name)
            item.add_marker(pytest.mark.falsifier)
            yield item


class RequirementItem(pytest.Item):
    """One requirement."""

    def __init__(self, *, requirement: str, **given: Any) -> None:
        super().__init__(**given)
        self._requirement = requirement

    def runtest(self) -> None:
        """Check the requirement with the options of the command line."""
        _check(self, f"{self.path}:{self._requirement}", {})

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Show only the message of an expected failure, without a traceback through the plugin."""
        from falsifier.core.literals import printable
        from falsifier.errors import FalsifierError

        expected = (
            FalsifiedError | UntestedError | RequirementWarning | FalsifierError | OSError | MemoryError
        )
        if isinstance(excinfo.value, expected):
            return printable(str(excinfo.value)) or "not enough memory"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Report the spec file and the requirement as the item's location."""
        return self.path, None, f"{self.path.name}:{self.name}"


@pytest.fixture
def falsifier_check(request: pytest.FixtureRequest) -> Callable[..., "Checked"]:
    """Fixture: ``falsifier_check(problem, budget=..., engine=...)`` fails if a violation is found.

    The problem is a ``Problem``, or a target of ``falsifier run``: ``"AT1"``, ``"my.toml:REQ"``. The options
    are those of the marker: budget, engine, seed, strict, database.
    """

    def check(problem: "Problem | str | PathLike[str]", **options: Any) -> "Checked":
        __tracebackhide__ = True
        _check_names("falsifier_check", options)
        from falsifier.errors import FalsifierError

        try:
            return _check(request.node, problem, options)
        except FalsifierError as error:  # what is wrong stands in the test, not within falsifier
            raise error.with_traceback(None) from None

    return check


def _check_names(what: str, options: dict[str, Any]) -> None:
    __tracebackhide__ = True
    if unknown := options.keys() - set(_OPTIONS):
        raise TypeError(
            f"{what}: unknown arguments {', '.join(sorted(unknown))}; expected some of {', '.join(_OPTIONS)}"
        )


def _marked(item: pytest.Item) -> dict[str, Any]:
    """Options of the item's markers; the nearest one counts."""
    __tracebackhide__ = True
    options: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers("falsifier"))):
        if marker.args:
            raise TypeError(
                f"pytest.mark.falsifier: got {marker.args[0]!r} without a name; write it as one of "
                f"{'=, '.join(_OPTIONS)}="
            )
        _check_names("pytest.mark.falsifier", dict(marker.kwargs))
        options |= marker.kwargs
    return options


def _check(item: pytest.Item, problem: "Problem | str | PathLike[str]", stated: dict[str, Any]) -> "Checked":
    """Check a problem and fail if its requirement is violated."""
    __tracebackhide__ = True
    from falsifier.core.arguments import instance
    from falsifier.counterexamples.regression import Database, check
    from falsifier.problem.loading import load_problem
    from falsifier.problem.problem import Problem

    options = {name: _setting(item.config, name) for name in _OPTIONS} | _marked(item) | stated
    instance("strict", options["strict"], (bool, type(None)), "True or False")
    target = "a Problem, or the name of one as for falsifier run, such as 'specs/car.toml:no_speeding'"
    instance("falsifier_check", problem, (Problem, str, PathLike), target)
    database = Database(_database(item.config, options["database"]))
    if options["engine"] is not None:
        _check_engine(options["engine"])
    loaded = problem if isinstance(problem, Problem) else load_problem(problem)
    try:
        checked = check(
            loaded,
            engine=options["engine"],
            budget=_DEFAULT_BUDGET if options["budget"] is None else options["budget"],
            seed=0 if options["seed"] is None else options["seed"],
            database=database,
        )
        for file, replayed in checked.replayed.items():
            if replayed.status == "does not fit":
                text = (
                    f"{_short(file)} tests nothing. {replayed.text}. Undo what has changed, or delete "
                    "the file; a search may find another one"
                )
                # Where warnings are errors, a violation is the more important one.
                with suppress(UnusedCounterexampleWarning) if checked.counterexample else nullcontext():
                    _warn(UnusedCounterexampleWarning, file, text)
        if checked.counterexample is not None:
            raise FalsifiedError(_message(item, checked, database))
    finally:
        loaded.model.close()
    _tell_doubts(item, checked, strict=bool(options["strict"]))
    return checked


def _tell_doubts(item: pytest.Item, checked: "Checked", *, strict: bool) -> None:
    """Warn of what was not tested, also because simulations failed, and not confirmed, or fail."""
    __tracebackhide__ = True
    name, result = checked.problem.name, checked.result
    untested = [f.text for f in result.findings if f.untested] if result else []
    untested += [failure.text for failure in result.failures] if result else []
    again = ((file, r) for file, r in checked.replayed.items() if r.confirmation)
    unconfirmed = [f"{_short(file)}: {replayed.text}" for file, replayed in again]
    unconfirmed += [f"{c.outcome}: {c.reason}" for c in (*result.fragile, *result.refuted)] if result else []
    told: list[tuple[type[RequirementWarning], str, list[str]]] = [
        (UnconfirmedWarning, f"{name} was violated, but no violation is confirmed", unconfirmed),
        (UntestedWarning, f"{name} is not falsified, but not all of it was tested", untested),
    ]
    texts = {kind: "\n".join((said, *lines)) for kind, said, lines in told if lines}
    if texts and strict:
        raise UntestedError("\n".join(texts.values()))
    for kind, text in texts.items():
        _, line, _ = item.reportinfo()
        _warn(kind, item.path, text, (line or 0) + 1)


def _setting(config: pytest.Config, name: str) -> Any:
    """Value from the command line, otherwise from the ini file, otherwise None."""
    key = f"falsifier_{name}"
    stated = config.getoption(key)
    try:
        found = (config.getini(key) or None) if stated is None else stated
    except (ValueError, TypeError, pytest.UsageError) as error:
        raise pytest.UsageError(f"{key}: {error}") from None
    if found is None or name not in _NUMBERS:
        return found
    least, most = _NUMBERS[name]
    with suppress(ValueError):
        if least <= (number := int(found)) <= most:
            return number
    raise pytest.UsageError(f"{key}: expected a whole number from {least} to {most}, got {found!r}")


def _check_engine(name: str) -> None:
    """Refuse an engine that does not exist, or that needs a language model; SpecError."""
    from falsifier.engines import check_engine
    from falsifier.errors import SpecError
    from falsifier.search.make_engines import LLM_ENGINES

    if name in LLM_ENGINES:
        raise SpecError(f"engine: {name} asks a language model, and tests ask none")
    check_engine(name)


def _database(config: pytest.Config, stated: Any) -> Path:
    """Folder of stored counterexamples."""
    from falsifier.core.arguments import path_of

    return config.rootpath / path_of("database", stated or _setting(config, "database") or _DEFAULT_DATABASE)


def _message(item: pytest.Item, checked: "Checked", database: "Database") -> str:
    """The counterexample, its picture, the command that replays it, and the explanation."""
    from falsifier.core.files import file_name
    from falsifier.core.words import candidate_facts
    from falsifier.counterexamples.explain import explain
    from falsifier.views.plotting import plot_evaluation, save_figure
    from falsifier.views.text import broken_facts, fact_lines

    problem, found = checked.problem, checked.counterexample
    assert found is not None
    # With -p no:cacheprovider pytest has no cache, and its configuration not even the attribute.
    cache = getattr(item.config, "cache", None)
    kept = item.config.rootpath if checked.file is None else checked.file.parent
    try:
        picture = (cache.mkdir("falsifier") if cache else kept) / f"{file_name(item.nodeid)}.png"
        save_figure(plot_evaluation(problem, found.evaluation), picture)
        drawn = str(_short(picture))
    except OSError as error:
        drawn = f"cannot be written: {error.strerror}"
    how = "stored counterexample" if checked.result is None else "counterexample found by a search"
    facts = [
        *broken_facts(found.evaluation.verdict),
        ("requirement", str(problem.requirement.formula)),
        ("confirmed", found.reason),
        *candidate_facts(found.evaluation.candidate, problem.space),
        ("picture", drawn),
    ]
    if checked.file is not None:
        facts.append(("stored", str(_short(checked.file))))
        facts.append(("replay with", _command(item, checked.file, database)))
    if checked.not_stored:
        facts.append(("not stored", checked.not_stored))
    head, why = f"{problem.name} is violated by a {how}", explain(problem, found.evaluation).text
    return "\n".join([head, *fact_lines(facts), "", why])


def _command(item: pytest.Item, file: Path, database: "Database") -> str:
    """Command that replays the counterexample; the test itself if its file cannot load this problem."""
    from falsifier.core.literals import shell_word
    from falsifier.counterexamples.store import load_counterexample

    stored = load_counterexample(file)
    # A file that was moved here loads what it was found for.
    if stored.problem is not None and database.place(stored.requirement, stored.problem) == file.parent:
        return f"falsifier replay {shell_word(_short(file))}"
    options = ["--falsifier"] if isinstance(item, RequirementItem) else []
    if folder := item.config.getoption("falsifier_database"):
        options += ["--falsifier-database", shell_word(folder)]
    # As seen from here, and not from pytest's root.
    name = "::".join((str(_short(item.path)), *item.nodeid.split("::")[1:]))
    return " ".join(["pytest", *options, shell_word(name)])


def _short(path: Path) -> Path:
    """Return the path relative to the working directory if it is below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
