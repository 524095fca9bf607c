"""Random formulas and trajectories with many ties: small whole numbers, short windows, few samples."""

import random
from dataclasses import fields
from typing import Any

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.stl import formula as stl
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Negative, Number

STEP = 0.5
SIGNALS = ("x", "y", "der(b)")
# All classes of formulas with operands, so that an operator that is added is tested with the others.
OPERATORS: list[Any] = [
    kind
    for name, kind in vars(stl).items()
    if isinstance(kind, type) and issubclass(kind, stl.Formula) and name[0] != "_"
    if kind is not stl.Formula and not issubclass(kind, stl.Predicate | stl.Constant)
]


def random_expression(rng: random.Random, depth: int) -> Expression:
    if depth == 0 or rng.random() < 0.4:
        return Name(rng.choice(SIGNALS)) if rng.random() < 0.7 else Number(float(rng.randint(-3, 3)))
    below = [random_expression(rng, depth - 1) for _ in range(2)]
    choice = rng.randrange(6)
    if choice < 3:
        return Arithmetic(("+", "-", "*")[choice], below[0], below[1])
    if choice == 3:
        return Call(rng.choice(("min", "max")), tuple(below))
    if choice == 4:
        return Call("abs", (below[0],))
    return Arithmetic("^", below[0], Number(2.0)) if rng.random() < 0.3 else negative(below[0])


def negative(operand: Expression) -> Expression:
    return Number(0.0 - operand.value) if isinstance(operand, Number) else Negative(operand)


def random_formula(rng: random.Random, depth: int, *, windows: bool = True) -> stl.Formula:
    """Formula of at most this depth; operators without a window have no window inside."""
    if depth == 0 or rng.random() < 0.15:
        operator: stl.Comparison = rng.choice(("<", "<=", ">", ">=", "==", "!="))
        return stl.Predicate(operator, random_expression(rng, 2), random_expression(rng, 1))
    kind = rng.choice(OPERATORS)
    *operands, last = (f.name for f in fields(kind))
    has_window = last == "window"
    window = random_window(rng) if windows and rng.random() < 0.8 else None

    def below() -> stl.Formula:
        part = random_formula(rng, depth - 1, windows=windows)
        while has_window and window is None and part.horizon(STEP) > 0:
            part = random_formula(rng, depth - 1, windows=windows)
        return part

    found: stl.Formula = kind(*(below() for _ in operands), window if has_window else below())
    return found


def random_window(rng: random.Random) -> stl.Window:
    start = rng.randint(0, 3)
    return stl.Window(start * STEP, (start + rng.randint(0, 4)) * STEP)


def random_trajectory(rng: random.Random, samples: int) -> Trajectory:
    """Columns of small whole numbers, sometimes constant."""
    generator = np.random.default_rng(rng.getrandbits(32))
    columns = {
        name: generator.integers(-4, 5, samples).astype(np.float64)
        if rng.random() < 0.9
        else np.full(samples, float(rng.randint(-3, 3)))
        for name in SIGNALS
    }
    return Trajectory(np.arange(samples, dtype=np.float64) * STEP, columns)


def random_case(seed: int, *, depth: int = 4) -> tuple[stl.Formula, Trajectory]:
    """Formula and a trajectory that is just long enough, or a little longer."""
    rng = random.Random(seed)
    formula = random_formula(rng, rng.randint(0, depth))
    samples = round(formula.horizon(STEP) / STEP) + 1 + rng.choice((0, 0, 1, 3))
    return formula, random_trajectory(rng, samples)
