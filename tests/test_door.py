"""The public API as a user's type checker and editor see it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import falsifier
from falsifier.core.files import bundled
from falsifier.errors import FalsifierError
from tests.command import ROOT
from tests.problems import easy
from tests.searches import Wrapped

AT = bundled("fmus") / "AT.fmu"
USER = ROOT / "tests" / "user_code.py"


def test_a_users_file_is_typed(tmp_path: Path) -> None:
    """Without the checkout's settings, as users have no plugin for pydantic and check no installed package.

    What is skipped takes half of the time; it is in no type of the door.
    """
    settings = tmp_path / "mypy.ini"
    settings.write_text("[mypy]\n[mypy-IPython.*,httpx.*,openai.*]\nfollow_imports = skip\n")
    options = [
        "--strict",
        f"--config-file={settings}",
        "--follow-imports=silent",
        "--cache-dir=.mypy_cache/user",
    ]
    command = [sys.executable, "-m", "mypy", *options, str(USER)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", dir(falsifier))
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(falsifier, name) is not None
    assert name in dir(falsifier)


# What a user without a type checker may write.
untyped: Any = falsifier
PROBLEM = r"problem: expected a Problem, such as load_problem\('AT1'\), got 'AT1' \(str\)"
CANDIDATE = falsifier.Candidate()
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "a tuple of limits": (lambda: untyped.InputRange("u", 0.0, 1.0, free=(3, 1)), r"'u': free: .*Freedom"),
    "no formula": (lambda: untyped.parse(None), "text of a formula, got None"),
    "a number as description": (
        lambda: untyped.Requirement("R", untyped.parse("G[0,1] (x <= 1)"), description=5),
        "'R': description: expected text, got 5",
    ),
    "a monitor of text": (lambda: untyped.Monitor("..", 0.1, 11), r"use parse\('..'\)"),
    "one problem to resume": (
        lambda: untyped.resume("runs/x", problems=easy()),
        "problems: expected a list of Problem",
    ),
    "a list of inputs": (
        lambda: untyped.Problem.from_fmu("my.fmu", "G[0,1] (x <= 1)", inputs=["u"]),
        r"inputs: expected choices by name.*\['u'\]",
    ),
    "a number as FMU": (
        lambda: untyped.Problem.from_fmu(3, "x <= 1"),
        r"fmu: expected the path.*got 3 \(int",
    ),
    "a number to read": (lambda: untyped.read_info(3), r"path: expected the path of an FMU, got 3 \(int\)"),
    "no problems": (lambda: untyped.falsify([]), "problem: the list is empty; expected Problems, or targets"),
    "no runs": (
        lambda: untyped.cross(["AT1"], ["uniform"], seeds=[], budget=1),
        "expected at least one of each",
    ),
    "an engine of one's own in a campaign": (
        lambda: untyped.cross(["AT1"], [Wrapped(easy()), "uniform"], seeds=[0], budget=1),
        "searchers: .* got an engine made in Python, which cannot be in a campaign: for each seed, call fal",
    ),
    "a class as engine": (lambda: untyped.falsify(easy(), Wrapped), "expected an instance, such as Wrapped"),
    "a list of trajectories": (
        lambda: untyped.Monitor(untyped.parse("x <= 1"), 1.0, 2).batch([]),
        "columns: expected arrays by signal name, each with a row per trajectory",
    ),
    "a text of problems": (
        lambda: untyped.cross("AT1", ["uniform"], seeds=[0], budget=1),
        "problems: expected a list of targets",
    ),
    "a number as model": (lambda: untyped.FmuModel(3), r"path: expected a path, got 3 \(int\)"),
    "an FMU as package": (lambda: untyped.read_package(AT), r"AT\.fmu: expected the path of an \.ssp or"),
    "a number as target": (lambda: untyped.load_problem(3), "target: expected text, got 3"),
    "a number to check": (lambda: untyped.lint(3), "target: expected text, got 3"),
    "a number as run": (lambda: untyped.resume(3), r"directory: expected the directory of a run, got 3"),
    "a list as campaign": (
        lambda: untyped.run_campaign([], "c"),
        r"request: expected CampaignRequest\(runs=",
    ),
    "a number as limits": (
        lambda: untyped.resume_campaign("c", limits=3),
        "limits: expected a Budget, got 3",
    ),
    "one listener of all runs": (
        lambda: untyped.run_campaign(3, "c", listeners=print),
        "listeners: expected a list of",
    ),
    "a text as list": (lambda: untyped.load_problem("AT1", context="a.mo"), "context: expected a list of"),
    "a number as language model": (
        lambda: untyped.falsify(easy(), llm=3),
        "llm: expected a name, LLMSettings",
    ),
    "what templates lack": (
        lambda: untyped.Problem.from_fmu(AT, "rise signal=speed"),
        "^stl: reference: this key is missing",
    ),
    "no range": (
        lambda: untyped.Problem.from_fmu(AT, "G (speed <= 1)", inputs={"throttle": 3, "brake": 0}),
        r"a value keeps throttle and brake constant.* add inputs=\{'NAME': \(LOW, HIGH\)\}",
    ),
    "no requirement": (
        lambda: untyped.load_problem(AT),
        r"no requirement; use load_problem\('.*AT\.fmu', stl='G\[0,10\]",
    ),
    "a search without a requirement": (lambda: untyped.falsify(str(AT)), r"use load_problem\('.*', stl='G"),
    "several requirements": (lambda: untyped.falsify("AT"), r"falsify\(load_problems\('AT'\)\) searches"),
    "no target": (lambda: untyped.load_problem(""), "the target is empty; give a spec file"),
    "a folder": (lambda: untyped.load_problem("."), r"resume\('\.'\) continues it"),
    "no language model": (lambda: untyped.falsify(easy(), engine="hybrid"), r"name one \(llm=NAME\)"),
    "units that differ": (
        lambda: untyped.System({"a": AT}, {"a.throttle": "a.speed"}),
        "state factor and offset of this connection$",
    ),
    "a text to search": (
        lambda: untyped.Problem.from_fmu(AT, "G (speed <= 1)", parameters={"wheelRadius": "big"}),
        r"^parameters\.wheelRadius: .*: parameters=\{'wheelRadius': \(LOW, HIGH\)\}",
    ),
    "a division by zero": (
        lambda: untyped.Problem.from_fmu(AT, "G[0,20] (1/0 < speed)"),
        "^stl: (?!.*fits all times)",
    ),
    "a name given twice": (
        lambda: untyped.Problem.from_fmu(
            AT, "G (speed <= 1)", inputs={"throttle": (0, 100)}, parameters={"throttle": (0, 1)}
        ),
        "throttle: given in inputs and in parameters; drop one",
    ),
    "a step longer than the interval": (
        lambda: untyped.Problem.from_fmu(AT, "speed <= 1", output_interval=0.01, step_size=0.02),
        "^output_interval: .* is not an integer multiple of step_size = 0.02 s; try step_size = 0.01",
    ),
    "a number to evaluate": (lambda: untyped.evaluate(easy(), 5), "candidate: expected a Candidate, got 5"),
    "a name to evaluate": (lambda: untyped.evaluate("AT1", CANDIDATE), PROBLEM),
    "a name to simulate": (lambda: untyped.simulate("AT1"), PROBLEM),
    "a name to assess": (lambda: untyped.assess("AT1", budget=1), PROBLEM),
    "a name to find a margin of": (lambda: untyped.margin("AT1", "x <= {limit}", (0, 1)), PROBLEM),
    "one end of a range": (lambda: untyped.margin(easy(), "x <= {limit}", 3), "between: expected a list"),
    "three ends of a range": (lambda: untyped.margin(easy(), "x <= {limit}", (0, 1, 2)), r"\(LOW, HIGH\)"),
    "a number as threshold": (lambda: untyped.margin(easy(), 5, (0, 1)), "vary: expected text, got 5"),
    "a number to confirm": (lambda: untyped.confirm(easy(), 5), "evaluation: expected an Evaluation"),
    "a number to map": (lambda: untyped.robustness_map(easy(), 5), "evaluation: expected an Evaluation"),
    "a run to start from": (
        lambda: untyped.falsify(easy(), start_from="at1"),
        "start_from: expected a list of Candidate, got 'at1'",
    ),
    "a limit of what costs nothing": (
        lambda: untyped.falsify(easy(), budget=falsifier.Budget(cost=1.0)),
        "budget: tokens and cost limit a language model, and none is named",
    ),
    "one listener": (lambda: untyped.falsify(easy(), listeners=print), "listeners: expected a list of func"),
    "a name to make an engine for": (lambda: untyped.make_engine("surrogate", "AT1", seed=0), PROBLEM),
    "a seed below 0": (lambda: untyped.make_engine("uniform", easy(), seed=-1), "seed: expected"),
    "a text as seed": (lambda: untyped.make_engine("uniform", easy(), seed="x"), "seed: expected"),
    "an argument that an engine does not have": (
        lambda: untyped.make_engine("uniform", easy(), seed=0, sead=1),
        "engine 'uniform': got an unexpected keyword argument 'sead'; it takes problem, seed",
    ),
    "a number as engine": (lambda: untyped.make_engine(3, easy(), seed=0), "engine: expected a name, got 3"),
    "a text as reply": (
        lambda: untyped.falsify(easy(), llm=SimpleNamespace(llm="own", complete=lambda _: "yes")),
        r"complete\(\) of the chat: expected a falsifier.llm.messages.ChatReply, got 'yes'",
    ),
    "a number to connect to": (lambda: untyped.connect(3), "llm: expected a name such as openai/gpt"),
    "a number as a component's name": (
        lambda: untyped.System({3: "a.fmu"}),
        "components: expected names of FMUs that are texts, got 3",
    ),
    "nothing as a component": (lambda: untyped.Component(None), "fmu: expected the path of an FMU, got None"),
    "nothing to load": (lambda: untyped.analysis.load(None), "directory: expected a path, got None"),
    "a number as a system's name": (
        lambda: untyped.System({"a": "a.fmu"}, name=3),
        "name: expected a text, got 3",
    ),
    "lists as trajectory": (lambda: untyped.Trajectory([0, 1], {"x": [1, 2]}), "times: expected an array of"),
    "NaN in a signal": (
        lambda: untyped.Signal((0.0, 1.0), (0.0, float("nan"))),
        "must be finite numbers, got nan",
    ),
    "a text in a signal": (lambda: untyped.Signal((0.0,), ("a",)), "expected sequences of numbers"),
    "numbers as signal": (lambda: untyped.Signal(0.0, 1.0), "expected sequences of numbers"),
    "an unknown interpolation": (lambda: untyped.Signal((0.0,), (0.0,), "cubic"), "interpolation: expected"),
    "a coupling of an unknown kind": (lambda: untyped.Coupling(loops="x"), "coupling.loops: expected refuse"),
    "a text as factor": (
        lambda: untyped.Connection("a.y", factor="a"),
        "a.y: factor: expected a finite number, got 'a'",
    ),
    "a text without name": (lambda: untyped.Requirement("", "x <= 1"), "expected a name, got ''"),
    "a number as name": (
        lambda: untyped.Problem.from_fmu(AT, "G (speed <= 1)", name=5),
        "requirement: expected a name, got 5",
    ),
    "a result to explain": (lambda: untyped.explain(easy(), 5), "evaluation: expected an Evaluation"),
    "a number to shrink": (lambda: untyped.shrink(easy(), 5), "evaluation: expected an Evaluation"),
    "a device as directory": (
        lambda: untyped.falsify(easy(), budget=1, directory="/dev/null"),
        "/dev/null: no folder",
    ),
    "a name that is too long": (
        lambda: untyped.falsify(easy(), budget=1, directory="n" * 300),
        "no folder can be made here",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_of_a_wrong_type_is_named_with_what_was_expected(what: str) -> None:
    call, message = WRONG[what]
    with pytest.raises(FalsifierError, match=message):
        call()
