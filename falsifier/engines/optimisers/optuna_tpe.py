"""The tree-structured Parzen estimator (TPE) of the package ``optuna``."""

import warnings

import numpy as np
import optuna

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem


class TPE(BoxEngine):
    """Optuna's multivariate TPE, with a study in memory.

    Points not yet evaluated count as bad ones ("constant liar"), which spreads a batch. Evaluations of other
    engines' candidates are added as finished trials.
    """

    name = "optuna"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._names = [f"x{i}" for i in range(self.box.dimension)]
        self._distributions: dict[str, optuna.distributions.BaseDistribution] = {
            name: optuna.distributions.FloatDistribution(0.0, 1.0) for name in self._names
        }
        self._study = _quiet_study(seed)
        self._open: list[tuple[optuna.Trial, Array]] = []

    def _propose(self, rng: np.random.Generator) -> Proposal:
        trial = self._study.ask(self._distributions)
        point = np.array([trial.params[name] for name in self._names])
        self._open.append((trial, point))
        return Proposal(point, f"trial {trial.number + 1} of the tree-structured Parzen estimator")

    def _learn(self, point: Array, evaluation: Evaluation) -> None:
        cost = evaluation.robustness
        for i, (trial, own) in enumerate(self._open):
            if self._is_same(point, own):
                del self._open[i]
                if cost is None:
                    self._study.tell(trial, state=optuna.trial.TrialState.FAIL)
                else:
                    self._study.tell(trial, cost)
                return
        if cost is not None:
            params = dict(zip(self._names, point.tolist(), strict=True))
            self._study.add_trial(
                optuna.create_trial(params=params, distributions=self._distributions, value=cost)
            )


def _quiet_study(seed: int) -> optuna.Study:
    """Create a study in memory, without its log message and without warnings about experimental options."""
    verbosity = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True)
        return optuna.create_study(sampler=sampler)
    finally:
        optuna.logging.set_verbosity(verbosity)
