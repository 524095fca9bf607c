"""Search engines by name; the module of an engine is imported when the engine is first created."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from falsifier.core.arguments import instance, whole
from falsifier.engines.protocol import Engine
from falsifier.errors import SpecError, did_you_mean, setting

if TYPE_CHECKING:
    from falsifier.problem.problem import Problem


@dataclass(frozen=True, slots=True)
class Registered:
    """One registered engine."""

    target: str  # ``module:class``; the class is called as ``class(problem, seed=seed, **options)``
    summary: str  # one line for ``--help``
    # Extra of this project that installs the package which the engine needs; it has the engine's name.
    extra: str = ""
    # Whether it chooses control points itself if the space allows it; others search the fixed ones.
    is_free: bool = False
    uses_context: bool = False  # whether it tries the levels that context files give

    def load(self) -> Any:
        """Import the engine's class; SpecError if the package that it needs is not installed."""
        module, _, name = self.target.partition(":")
        try:
            return getattr(import_module(module), name)
        except ImportError as error:
            if not self.extra:
                raise
            raise SpecError(
                f"the engine {self.extra!r} needs a package that is not installed ({error}); "
                f"install it with pip install 'falsifier[{self.extra}]'"
            ) from None


ENGINES: Mapping[str, Registered] = MappingProxyType(
    {
        "surrogate": Registered(
            "falsifier.engines.surrogate:Surrogate",
            "learns the dynamics and searches on its predictions",
            is_free=True,
            uses_context=True,
        ),
        "coverage": Registered(
            "falsifier.engines.coverage:CoverageEngine",
            "goes on from inputs that reached something new; does not use robustness",
            is_free=True,
        ),
        "uniform": Registered("falsifier.engines.simple:Uniform", "uniform random points"),
        "corners": Registered("falsifier.engines.simple:Corners", "constant extremes first, then random"),
        "cma": Registered("falsifier.engines.optimisers.cma:CMA", "covariance matrix adaptation (CMA-ES)"),
        "bayesian": Registered(
            "falsifier.engines.optimisers.bayesian:Bayesian", "Gaussian processes in a trust region"
        ),
        "optuna": Registered(
            "falsifier.engines.optimisers.optuna_tpe:TPE",
            "optuna's tree-structured Parzen estimator",
            extra="optuna",
        ),
        "hybrid": Registered(
            "falsifier.engines.hybrid:Hybrid",
            "a language model with the surrogate",
            is_free=True,
            uses_context=True,
        ),
    }
)

DEFAULT_ENGINE = "surrogate"


def check_engine(name: str) -> None:
    """Check that an engine of this name exists; SpecError if there is none; lists the known names."""
    instance(setting("engine"), name, str, "a name")
    if name not in ENGINES:
        raise SpecError(f"{setting('engine')}: unknown engine {name!r}; {did_you_mean(name, ENGINES)}")


def make_engine(name: str, problem: "Problem", *, seed: int, **options: Any) -> Engine:
    """Create the engine with this name for a problem.

    Args:
        name: one of ENGINES.
        problem: the problem to search.
        seed: the same seed and the same sequence of calls give the same candidates.
        options: further arguments of the engine; ``hybrid`` requires ``adviser``.

    Raises:
        SpecError: if the name is unknown, the engine's package is not installed, the hybrid has no adviser,
            or the problem has nothing to search.
    """
    from falsifier.problem.problem import check_problem

    check_engine(name)
    check_problem(problem)
    whole("seed", seed, least=0)
    if not problem.space.names:
        raise SpecError("nothing to search; give at least one input or parameter a range")
    if name == "hybrid" and "adviser" not in options:
        raise SpecError("the hybrid takes an LLMEngine as adviser; falsify(..., llm=NAME) makes both")
    make = ENGINES[name].load()
    taken = signature(make)
    try:
        taken.bind(problem, seed=seed, **options)
    except TypeError as error:
        raise SpecError(f"engine {name!r}: {error}; it takes {', '.join(taken.parameters)}") from None
    engine: Engine = make(problem, seed=seed, **options)
    return engine
