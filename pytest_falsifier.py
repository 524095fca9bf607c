"""Requirements as pytest tests: ``pytest --falsifier specs/`` collects every requirement of every spec file.

Stored counterexamples are replayed first, then a search within a budget looks for a new one. Ordinary tests
use the fixture ``falsifier_check``. This module is outside the package, because pytest imports its plugins at
every start and the package takes time to import.
"""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from falsifier.counterexamples.regression import Checked
    from falsifier.problem.problem import Problem

_DEFAULT_BUDGET = 100
_DEFAULT_DATABASE = "counterexamples"
_OPTIONS = ("budget", "engine", "seed")


class UntestedWarning(UserWarning):
    """A requirement was not violated, but a part of it was not tested."""


class UntestedError(AssertionError):
    """The same with --falsifier-strict; reported by its message alone."""


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
        help="fail if a part of a requirement was not tested, such as a condition that never held",
    )
    parser.addini("falsifier_strict", "same as --falsifier-strict", type="bool")
    for name in (*_OPTIONS, "database"):
        parser.addini(f"falsifier_{name}", f"same as --falsifier-{name}")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        "falsifier(budget=, engine=, seed=): how to check a requirement; set on all collected requirements",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect spec files if --falsifier is given; other TOML files are left to other plugins."""
    if not parent.config.getoption("falsifier") or file_path.suffix != ".toml":
        return None
    import tomllib

    try:
        content = tomllib.loads(file_path.read_text(encoding="utf-8"))
    # Also not UTF-8, integers of any length, nested without end, unreadable.
    except (ValueError, RecursionError, OSError):
        return None
    if not {"model", "requirements"} <= content.keys():
        return None
    return SpecFile.from_parent(parent, path=file_path)


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

        expected = FalsifiedError | UntestedError | FalsifierError | OSError | MemoryError
        if isinstance(excinfo.value, expected):
            return printable(str(excinfo.value)) or "not enough memory"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Report the spec file and the requirement as the item's location."""
        return self.path, None, f"{self.path.name}:{self.name}"


@pytest.fixture
def falsifier_check(request: pytest.FixtureRequest) -> Callable[..., "Checked"]:
    """Fixture: ``falsifier_check(problem, budget=..., engine=..., seed=...)`` fails if a violation is found.

    The problem is a ``Problem``, or a target of ``falsifier run``: ``"AT1"``, ``"my.toml:REQ"``.
    """

    def check(problem: "Problem | str", **options: Any) -> "Checked":
        __tracebackhide__ = True
        unknown = options.keys() - set(_OPTIONS)
        if unknown:
            raise TypeError(
                f"falsifier_check: unknown arguments {', '.join(sorted(unknown))}; expected some of "
                f"{', '.join(_OPTIONS)}"
            )
        return _check(request.node, problem, options)

    return check


def _check(item: pytest.Item, problem: "Problem | str", stated: dict[str, Any]) -> "Checked":
    """Check a problem and fail if its requirement is violated."""
    __tracebackhide__ = True
    from falsifier.counterexamples.regression import Database, check
    from falsifier.problem.loading import load_problem

    config = item.config
    marker = item.get_closest_marker("falsifier")
    options = {
        **{name: _setting(config, name) for name in _OPTIONS},
        **(marker.kwargs if marker else {}),
        **stated,
    }
    loaded = load_problem(problem) if isinstance(problem, str) else problem
    folder = config.rootpath / (_setting(config, "database") or _DEFAULT_DATABASE)
    try:
        checked = check(
            loaded,
            engine=options["engine"],
            budget=int(_DEFAULT_BUDGET if options["budget"] is None else options["budget"]),
            seed=int(options["seed"] or 0),
            database=Database(folder),
        )
        if checked.counterexample is not None:
            raise FalsifiedError(_message(item, checked))
    finally:
        loaded.model.close()
    _tell_untested(item, checked)
    return checked


def _tell_untested(item: pytest.Item, checked: "Checked") -> None:
    """Warn of parts of the requirement that no simulation tested; fail if --falsifier-strict is given."""
    __tracebackhide__ = True
    found = [f.text for f in checked.result.findings if f.vacuous] if checked.result else []
    text = "\n".join((f"{checked.problem.name} is not violated, but not all of it was tested", *found))
    if found and _setting(item.config, "strict"):
        raise UntestedError(text)
    if found:
        _, line, _ = item.reportinfo()
        warnings.warn_explicit(text, UntestedWarning, filename=str(item.path), lineno=(line or 0) + 1)


def _setting(config: pytest.Config, name: str) -> Any:
    """Value from the command line, otherwise from the ini file, otherwise None."""
    stated = config.getoption(f"falsifier_{name}")
    return stated if stated is not None else config.getini(f"falsifier_{name}") or None


def _message(item: pytest.Item, checked: "Checked") -> str:
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
    pictures = cache.mkdir("falsifier") if cache else kept
    picture = pictures / f"{file_name(problem.name)}.png"
    save_figure(plot_evaluation(problem, found.evaluation), picture)
    how = "stored counterexample" if checked.result is None else "counterexample found by a search"
    lines = [
        f"{problem.name} is violated by a {how}",
        *fact_lines(broken_facts(found.evaluation.verdict)),
        f"  requirement    {problem.requirement.formula}",
        f"  confirmed      {found.reason}",
        *fact_lines(candidate_facts(found.evaluation.candidate, problem.space)),
        f"  picture        {_short(picture)}",
    ]
    if checked.file is not None:
        lines.append(f"  stored         {_short(checked.file)}")
        lines.append(f"  replay with    {_command(item, checked)}")
    return "\n".join([*lines, "", explain(problem, found.evaluation).text])


def _command(item: pytest.Item, checked: "Checked") -> str:
    """Command that replays the counterexample; if the problem was made in Python, the test itself."""
    from falsifier.counterexamples.store import load_counterexample

    assert checked.file is not None
    loadable = load_counterexample(checked.file).problem is not None
    return f"falsifier replay {_short(checked.file)}" if loadable else f"pytest '{item.nodeid}'"


def _short(path: Path) -> Path:
    """Return the path relative to the working directory if it is below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
