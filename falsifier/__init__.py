"""Falsify requirements of FMUs: find inputs that make a simulated system violate an STL formula.

Load a problem, choose who proposes, run::

    from falsifier import falsify, load_problem

    result = falsify(load_problem("AT1"), engine="corners", budget=100)

Everything heavy (numba, fmpy, litellm, matplotlib) is imported when it is first needed.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_EXPORTS = {
    "Budget": "falsifier.budget",
    "Candidate": "falsifier.space",
    "Evaluation": "falsifier.evaluation",
    "FalsifierError": "falsifier.errors",
    "FunctionModel": "falsifier.model",
    "Problem": "falsifier.problem",
    "Result": "falsifier.result",
    "SearchSpace": "falsifier.space",
    "Signal": "falsifier.signals",
    "Trajectory": "falsifier.trajectory",
    "evaluate": "falsifier.evaluation",
    "falsify": "falsifier.engine",
    "load_problem": "falsifier.loading",
}

__all__ = [*_EXPORTS, "__version__"]


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use, so that ``import falsifier`` stays cheap."""
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module 'falsifier' has no attribute {name!r}")
