from falsifier.problem import Problem
from falsifier.proposers import make_proposer
from falsifier.proposers.protocol import Proposer
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
