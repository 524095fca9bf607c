import pytest

from falsifier.engines import make_proposer
from falsifier.engines.protocol import Proposer
from falsifier.engines.surrogate import Settings
from falsifier.problem.problem import Problem
from falsifier.testing import ProposerContract


class EngineContract(ProposerContract):
    engine: str

    def make(self, problem: Problem, seed: int) -> Proposer:
        return make_proposer(self.engine, problem, seed=seed)


class TestUniform(EngineContract):
    engine = "uniform"


class TestCorners(EngineContract):
    engine = "corners"


class TestSobol(EngineContract):
    engine = "sobol"


class TestAnnealing(EngineContract):
    engine = "annealing"


class TestCMA(EngineContract):
    engine = "cma"


class TestBayesian(EngineContract):
    engine = "bayesian"


class TestOptuna(EngineContract):
    engine = "optuna"


class TestBoTorch(EngineContract):
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


class TestSurrogate(ProposerContract):
    def make(self, problem: Problem, seed: int) -> Proposer:
        return make_proposer("surrogate", problem, seed=seed, settings=HASTY)
