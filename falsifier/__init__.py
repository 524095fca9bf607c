"""Falsify requirements of FMUs: find inputs that make a simulated system violate an STL formula.

Load a problem, choose who proposes, run::

    from falsifier import falsify, load_problem

    result = falsify(load_problem("AT1"), engine="corners", budget=100)

Everything heavy (numba, fmpy, litellm, matplotlib) is imported when it is first needed.

The house has twelve rooms. Each imports from itself and from those above it, never from one below::

    core/             signals, search spaces, candidates, trajectories, models
    stl/              formulas, robustness and critical time
    fmu/              what FMUs say of themselves, and how they are stepped
    problem/          what is simulated, what must hold, what may be varied
    evaluation/       one candidate in, one evaluation out
    llm/              chat with language models
    engines/          who suggests the next candidates
    search/           one run: the loop, its budget, its record
    counterexamples/  stored, shrunk, explained, exported
    campaigns/        requirements x methods x seeds
    views/            what people see
    cli/              the command line
"""

import sys
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_EXPORTS = {
    "Budget": "falsifier.search.budget",
    "Candidate": "falsifier.core.candidate",
    "Evaluation": "falsifier.evaluation.evaluate",
    "FalsifierError": "falsifier.errors",
    "FunctionModel": "falsifier.core.model",
    "Problem": "falsifier.problem.problem",
    "Result": "falsifier.search.result",
    "SearchSpace": "falsifier.core.space",
    "Signal": "falsifier.core.signals",
    "Trajectory": "falsifier.core.trajectory",
    "evaluate": "falsifier.evaluation.evaluate",
    "falsify": "falsifier.search.loop",
    "load_problem": "falsifier.problem.loading",
}

__all__ = [*_EXPORTS, "__version__"]


def _register_formatters() -> None:
    """Have a notebook show the values of this package."""
    from falsifier.views.notebook import register

    register()


if "IPython" in sys.modules:
    _register_formatters()


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use, so that ``import falsifier`` stays cheap."""
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module 'falsifier' has no attribute {name!r}")
