"""Engines by name; an engine's module is imported when the engine is first made."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import Any

from falsifier.engines.protocol import Engine
from falsifier.errors import SpecError, did_you_mean
from falsifier.problem.problem import Problem


@dataclass(frozen=True, slots=True)
class Registered:
    """One registered engine.

    Attributes:
        target: ``module:class``; the class is called as ``class(problem, seed=seed, **options)``.
        summary: what it does, in one line for ``--help``.
        extra: of this project, which brings the package that the engine needs and is named after.
    """

    target: str
    summary: str
    extra: str = ""

    def load(self) -> Any:
        """Import the engine's class.

        Raises:
            SpecError: when the package that it needs is not installed.
        """
        module, _, name = self.target.partition(":")
        try:
            return getattr(import_module(module), name)
        except ImportError as error:
            if not self.extra:
                raise
            raise SpecError(
                f"the engine {self.extra!r} needs a package that is not installed ({error}): "
                f"pip install 'falsifier[{self.extra}]'"
            ) from None


ENGINES: Mapping[str, Registered] = MappingProxyType(
    {
        "surrogate": Registered(
            "falsifier.engines.surrogate:Surrogate", "learns the dynamics and searches on what it learnt"
        ),
        "uniform": Registered("falsifier.engines.uniform:Uniform", "uniform random points of the box"),
        "sobol": Registered("falsifier.engines.sobol:Sobol", "scrambled Sobol sequence over the box"),
        "corners": Registered("falsifier.engines.corners:Corners", "constant extremes first, then random"),
        "annealing": Registered("falsifier.engines.annealing:Annealing", "scipy's dual annealing"),
        "cma": Registered("falsifier.engines.cma:CMA", "covariance matrix adaptation (CMA-ES)"),
        "bayesian": Registered(
            "falsifier.engines.bayesian:Bayesian", "Gaussian process and expected improvement"
        ),
        "optuna": Registered(
            "falsifier.engines.optuna_tpe:TPE", "optuna's tree-structured Parzen estimators", extra="optuna"
        ),
        "botorch": Registered(
            "falsifier.engines.botorch_gp:BoTorch", "botorch's Gaussian process", extra="botorch"
        ),
        "hybrid": Registered("falsifier.engines.hybrid:Hybrid", "a language model and the surrogate"),
    }
)

DEFAULT_ENGINE = "surrogate"


def check_engine(name: str) -> None:
    """Refuse a name that is no engine's.

    Raises:
        SpecError: with the names there are.
    """
    if name not in ENGINES:
        raise SpecError(f"unknown engine {name!r}; {did_you_mean(name, ENGINES)}")


def make_engine(name: str, problem: Problem, *, seed: int, **options: Any) -> Engine:
    """Make the engine of this name for a problem.

    Args:
        name: one of ENGINES.
        problem: what is searched.
        seed: the same seed and the same sequence of calls give the same candidates.
        options: what the engine takes beside that; ``hybrid`` needs the language model's side.

    Raises:
        SpecError: for an unknown name, an engine whose package is not installed, or a problem in which
            nothing may be varied.
    """
    check_engine(name)
    if not problem.space.names:
        raise SpecError("nothing may be varied: give at least one input or parameter a range")
    engine: Engine = ENGINES[name].load()(problem, seed=seed, **options)
    return engine
