"""Compiles everything once, so that tests side by side need not each do it: ``python -m tests.compiling``."""

from falsifier.record.run import falsify
from falsifier.testing import lag_problem


def load_all() -> None:
    """Load everything that is compiled: what the surrogate predicts with."""
    falsify(lag_problem("G[0,10] (x <= 2)"), "surrogate", budget=12)


if __name__ == "__main__":
    load_all()
