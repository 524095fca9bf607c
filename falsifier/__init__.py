"""Falsify requirements of FMUs: find inputs that make a simulated system violate an STL formula.

::

    from falsifier import Problem, falsify

    problem = Problem.from_fmu("my.fmu", "G[0,10] (h >= 0)", inputs={"u": (-1, 1)})
    result = falsify(problem, budget=300)

Heavy dependencies (litellm, matplotlib) are imported on first use.

The code is divided into fifteen packages. Each imports only from itself and from those above it::

    core/             signals, search spaces, candidates, trajectories, models
    stl/              formulas, robustness and critical time
    fmu/              reading and simulating FMUs
    context/          what an engineer would read: Simulink files, sources, documents
    problem/          model, requirement and search space; spec files
    evaluation/       simulating and judging one candidate
    llm/              asking language models
    engines/          suggesting the next candidates
    search/           the loop that asks, simulates and judges within a budget
    record/           a run and its record: starting, resuming, journal, manifest
    analyses/         coverage, assurance, margins, lint, formalizing
    counterexamples/  storing, shrinking, explaining, exporting
    campaigns/        runs of requirements x methods x seeds
    views/            terminal text, figures, reports
    cli/              the command line

In addition, ``errors`` contains the exceptions and ``testing`` contract tests for engines of your own.
"""

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if sys.platform == "win32":
    raise ImportError(
        "falsifier does not run on Windows itself; install it in WSL2 (`wsl --install` gives you an Ubuntu), "
        "where FMUs for Windows run through Wine"
    )

# Written X as X, which tells type checkers that it is public.
if TYPE_CHECKING:
    from falsifier.analyses.assess import Assurance as Assurance, Searched as Searched, assess as assess
    from falsifier.analyses.coverage import Coverage as Coverage, coverage as coverage
    from falsifier.analyses.formalize import (
        Difference as Difference,
        Formalized as Formalized,
        Reading as Reading,
        formalize as formalize,
    )
    from falsifier.analyses.lint import LintFinding as LintFinding, lint as lint
    from falsifier.analyses.margin import Margin as Margin, margin as margin
    from falsifier.campaigns import (
        CampaignRequest as CampaignRequest,
        Method as Method,
        analysis as analysis,
        cross as cross,
        resume_campaign as resume_campaign,
        run_campaign as run_campaign,
        suite as suite,
    )
    from falsifier.core.candidate import Candidate as Candidate
    from falsifier.core.experiment import Experiment as Experiment
    from falsifier.core.function_model import FunctionModel as FunctionModel
    from falsifier.core.model import (
        Model as Model,
        ModelInfo as ModelInfo,
        Variable as Variable,
    )
    from falsifier.core.ranges import (
        Freedom as Freedom,
        InputRange as InputRange,
        ParameterRange as ParameterRange,
    )
    from falsifier.core.signals import Signal as Signal
    from falsifier.core.space import SearchSpace as SearchSpace
    from falsifier.core.trajectory import Trajectory as Trajectory
    from falsifier.counterexamples.explain import Explanation as Explanation, explain as explain
    from falsifier.counterexamples.robustness_map import (
        RobustnessMap as RobustnessMap,
        robustness_map as robustness_map,
    )
    from falsifier.counterexamples.shrink import Shrunk as Shrunk, shrink as shrink
    from falsifier.counterexamples.store import (
        Replayed as Replayed,
        StoredCounterexample as StoredCounterexample,
        load_counterexample as load_counterexample,
        replay as replay,
    )
    from falsifier.engines import (
        DEFAULT_ENGINE as DEFAULT_ENGINE,
        ENGINES as ENGINES,
        make_engine as make_engine,
    )
    from falsifier.engines.briefing import preview as preview
    from falsifier.engines.llm import LLMEngine as LLMEngine
    from falsifier.engines.protocol import AsksLLM as AsksLLM, Engine as Engine
    from falsifier.errors import FalsifierError as FalsifierError
    from falsifier.evaluation.confirm import Confirmation as Confirmation, confirm as confirm
    from falsifier.evaluation.evaluate import (
        Evaluation as Evaluation,
        evaluate as evaluate,
        monitor_for as monitor_for,
        simulate as simulate,
    )
    from falsifier.fmu import (
        Component as Component,
        Connection as Connection,
        Coupling as Coupling,
        FmuModel as FmuModel,
        Frame as Frame,
        System as System,
        read_info as read_info,
        read_package as read_package,
    )
    from falsifier.llm.connect import connect as connect
    from falsifier.llm.messages import Chat as Chat, Exchange as Exchange
    from falsifier.llm.prompts import VARIANTS as VARIANTS
    from falsifier.llm.scripted import ScriptedChat as ScriptedChat
    from falsifier.problem.loading import load_problem as load_problem, load_problems as load_problems
    from falsifier.problem.problem import Problem as Problem
    from falsifier.problem.requirement import Requirement as Requirement
    from falsifier.problem.source import ProblemSource as ProblemSource
    from falsifier.record.run import falsify as falsify, resume as resume
    from falsifier.search import events as events
    from falsifier.search.budget import Budget as Budget, Spent as Spent
    from falsifier.search.events import Event as Event, Listener as Listener
    from falsifier.search.request import LLMSettings as LLMSettings
    from falsifier.search.result import Result as Result
    from falsifier.stl import (
        Breach as Breach,
        Diagnosis as Diagnosis,
        Formula as Formula,
        Monitor as Monitor,
        Verdict as Verdict,
        parse as parse,
    )
    from falsifier.views import plotting as plotting
    from falsifier.views.plotting import plot as plot
    from falsifier.views.progress import progress as progress

    Figure = plotting.Figure  # for annotations only

# Where the public names are found, as type checkers read it above.
_PLACES = {
    name: module
    for module, names in re.findall(
        r"^ {4}from (falsifier\S+) import (\([^)]*\)|.+)", Path(__file__).read_text(encoding="utf-8"), re.M
    )
    for name in re.findall(r"(\w+) as \1", names)
}

if "IPython" in sys.modules:  # lets it show the values of this package as tables and figures
    import_module("falsifier.views.notebook").register()

if not TYPE_CHECKING:
    __all__ = ["__version__", *_PLACES]

    def __getattr__(name: str) -> object:
        """Import a public name from its module on first use, so that ``import falsifier`` stays cheap."""
        if name not in _PLACES:
            raise AttributeError(f"module 'falsifier' has no attribute {name!r}")
        module = import_module(_PLACES[name])
        return getattr(module, name) if hasattr(module, name) else import_module(f"{module.__name__}.{name}")


def __dir__() -> list[str]:
    return sorted(["__version__", *_PLACES])
