"""What is drawn."""

from falsifier import Evaluation, evaluate, falsify
from tests.problems import hard


def simulated() -> Evaluation:
    return evaluate(hard(), falsify(hard(), "corners", budget=1).evaluations[0].candidate)
