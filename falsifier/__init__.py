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

import sys
from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if sys.platform == "win32":
    raise ImportError(
        "falsifier does not run on Windows itself; install it in WSL2 (`wsl --install` gives you an Ubuntu), "
        "where FMUs for Windows run through Wine"
    )

if TYPE_CHECKING:
    from falsifier.analyses.assess import Assurance, Searched, assess
    from falsifier.analyses.coverage import Coverage, coverage
    from falsifier.analyses.formalize import Difference, Formalized, Reading, formalize
    from falsifier.analyses.lint import LintFinding, lint
    from falsifier.analyses.margin import Margin, margin
    from falsifier.campaigns import (
        CampaignRequest,
        Method,
        analysis,
        cross,
        resume_campaign,
        run_campaign,
        suite,
    )
    from falsifier.core.candidate import Candidate
    from falsifier.core.model import Experiment, FunctionModel, Model, ModelInfo, Variable
    from falsifier.core.signals import Signal
    from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace
    from falsifier.core.trajectory import Trajectory
    from falsifier.counterexamples.explain import Explanation, explain
    from falsifier.counterexamples.robustness_map import RobustnessMap, robustness_map
    from falsifier.counterexamples.shrink import Shrunk, shrink
    from falsifier.counterexamples.store import Replayed, StoredCounterexample, replay
    from falsifier.counterexamples.store import load as load_counterexample
    from falsifier.engines import DEFAULT_ENGINE, ENGINES, make_engine
    from falsifier.engines.briefing import preview
    from falsifier.engines.llm import LLMEngine
    from falsifier.engines.protocol import AsksLLM, Engine
    from falsifier.errors import FalsifierError
    from falsifier.evaluation.confirm import Confirmation, confirm
    from falsifier.evaluation.evaluate import Evaluation, evaluate, monitor_for, simulate
    from falsifier.fmu import (
        Component,
        Connection,
        Coupling,
        FmuModel,
        Frame,
        System,
        read_info,
        read_package,
    )
    from falsifier.llm.client import connect
    from falsifier.llm.messages import Chat, Exchange
    from falsifier.llm.prompts import VARIANTS
    from falsifier.llm.scripted import ScriptedChat
    from falsifier.problem.loading import load_problem, load_problems
    from falsifier.problem.problem import Problem
    from falsifier.problem.requirement import Requirement
    from falsifier.problem.source import ProblemSource
    from falsifier.record.run import falsify, resume
    from falsifier.search import events
    from falsifier.search.budget import Budget, Spent
    from falsifier.search.events import Event, Listener
    from falsifier.search.request import LLMSettings
    from falsifier.search.result import Result
    from falsifier.stl import Breach, Diagnosis, Formula, Monitor, Verdict, parse
    from falsifier.views import plotting
    from falsifier.views.plotting import Figure as Figure
    from falsifier.views.plotting import plot
    from falsifier.views.progress import progress

# Where the public names are found; one that has another name there is written PUBLIC:OTHER.
_NAMES = {
    "falsifier.analyses.assess": "Assurance Searched assess",
    "falsifier.analyses.coverage": "Coverage coverage",
    "falsifier.analyses.formalize": "Difference Formalized Reading formalize",
    "falsifier.analyses.lint": "LintFinding lint",
    "falsifier.analyses.margin": "Margin margin",
    "falsifier.campaigns": "CampaignRequest Method cross resume_campaign run_campaign suite",
    "falsifier.core.candidate": "Candidate",
    "falsifier.core.model": "Experiment FunctionModel Model ModelInfo Variable",
    "falsifier.core.signals": "Signal",
    "falsifier.core.space": "Freedom InputRange ParameterRange SearchSpace",
    "falsifier.core.trajectory": "Trajectory",
    "falsifier.counterexamples.explain": "Explanation explain",
    "falsifier.counterexamples.robustness_map": "RobustnessMap robustness_map",
    "falsifier.counterexamples.shrink": "Shrunk shrink",
    "falsifier.counterexamples.store": "Replayed StoredCounterexample load_counterexample:load replay",
    "falsifier.engines": "DEFAULT_ENGINE ENGINES make_engine",
    "falsifier.engines.briefing": "preview",
    "falsifier.engines.llm": "LLMEngine",
    "falsifier.engines.protocol": "AsksLLM Engine",
    "falsifier.errors": "FalsifierError",
    "falsifier.evaluation.confirm": "Confirmation confirm",
    "falsifier.evaluation.evaluate": "Evaluation evaluate monitor_for simulate",
    "falsifier.fmu": "Component Connection Coupling FmuModel Frame System read_info read_package",
    "falsifier.llm.client": "connect",
    "falsifier.llm.messages": "Chat Exchange",
    "falsifier.llm.prompts": "VARIANTS",
    "falsifier.llm.scripted": "ScriptedChat",
    "falsifier.problem.loading": "load_problem load_problems",
    "falsifier.problem.problem": "Problem",
    "falsifier.problem.requirement": "Requirement",
    "falsifier.problem.source": "ProblemSource",
    "falsifier.record.run": "falsify resume",
    "falsifier.search.budget": "Budget Spent",
    "falsifier.search.events": "Event Listener",
    "falsifier.search.request": "LLMSettings",
    "falsifier.search.result": "Result",
    "falsifier.stl": "Breach Diagnosis Formula Monitor Verdict parse",
    "falsifier.views.plotting": "plot",
    "falsifier.views.progress": "progress",
}
_EXPORTS = {
    public: (module, other or public)
    for module, names in _NAMES.items()
    for public, _, other in (name.partition(":") for name in names.split())
}
_MODULES = {
    "analysis": "falsifier.campaigns.analysis",
    "events": "falsifier.search.events",
    "plotting": "falsifier.views.plotting",
}

__all__ = [
    "DEFAULT_ENGINE",
    "ENGINES",
    "VARIANTS",
    "AsksLLM",
    "Assurance",
    "Breach",
    "Budget",
    "CampaignRequest",
    "Candidate",
    "Chat",
    "Component",
    "Confirmation",
    "Connection",
    "Coupling",
    "Coverage",
    "Diagnosis",
    "Difference",
    "Engine",
    "Evaluation",
    "Event",
    "Exchange",
    "Experiment",
    "Explanation",
    "FalsifierError",
    "FmuModel",
    "Formalized",
    "Formula",
    "Frame",
    "Freedom",
    "FunctionModel",
    "InputRange",
    "LLMEngine",
    "LLMSettings",
    "LintFinding",
    "Listener",
    "Margin",
    "Method",
    "Model",
    "ModelInfo",
    "Monitor",
    "ParameterRange",
    "Problem",
    "ProblemSource",
    "Reading",
    "Replayed",
    "Requirement",
    "Result",
    "RobustnessMap",
    "ScriptedChat",
    "SearchSpace",
    "Searched",
    "Shrunk",
    "Signal",
    "Spent",
    "StoredCounterexample",
    "System",
    "Trajectory",
    "Variable",
    "Verdict",
    "__version__",
    "analysis",
    "assess",
    "confirm",
    "connect",
    "coverage",
    "cross",
    "evaluate",
    "events",
    "explain",
    "falsify",
    "formalize",
    "lint",
    "load_counterexample",
    "load_problem",
    "load_problems",
    "make_engine",
    "margin",
    "monitor_for",
    "parse",
    "plot",
    "plotting",
    "preview",
    "progress",
    "read_info",
    "read_package",
    "replay",
    "resume",
    "resume_campaign",
    "robustness_map",
    "run_campaign",
    "shrink",
    "simulate",
    "suite",
]


def _register_formatters() -> None:
    """Let IPython show the values of this package as tables and figures."""
    from falsifier.views.notebook import register

    register()


if "IPython" in sys.modules:
    _register_formatters()

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Import a public name from its module on first use, so that ``import falsifier`` stays cheap."""
        if name in _MODULES:
            return import_module(_MODULES[name])
        if name in _EXPORTS:
            module, original = _EXPORTS[name]
            return getattr(import_module(module), original)
        raise AttributeError(f"module 'falsifier' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
