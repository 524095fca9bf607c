import pytest

from falsifier.engines import make_engine
from falsifier.engines.protocol import Engine
from falsifier.engines.surrogate import Settings
from falsifier.problem.problem import Problem
from falsifier.testing import EngineContract


class NamedEngine(EngineContract):
    engine: str

    def make(self, problem: Problem, seed: int) -> Engine:
        return make_engine(self.engine, problem, seed=seed)


class TestUniform(NamedEngine):
    engine = "uniform"


class TestCorners(NamedEngine):
    engine = "corners"


class TestSobol(NamedEngine):
    engine = "sobol"


class TestAnnealing(NamedEngine):
    engine = "annealing"


class TestCMA(NamedEngine):
    engine = "cma"


class TestBayesian(NamedEngine):
    engine = "bayesian"


class TestOptuna(NamedEngine):
    engine = "optuna"


class TestBoTorch(NamedEngine):
    engine = "botorch"
    # Enough to get beyond the Sobol points, which are twice the coordinates and two.
    rounds = 15

    @pytest.fixture(autouse=True)
    def installed(self) -> None:
        pytest.importorskip("botorch", reason="it brings torch, several hundred MB")


# The contract does not depend on how thorough a plan is.
HASTY = Settings(
    cells=20, features=16, pool=40, children=20, generations=2, vertex_steps=1, region_start=3, trial=2
)


class TestSurrogate(NamedEngine):
    def make(self, problem: Problem, seed: int) -> Engine:
        return make_engine("surrogate", problem, seed=seed, settings=HASTY)
