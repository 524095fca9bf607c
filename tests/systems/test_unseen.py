"""The systems on which engines are developed and judged: their known violations, simulated and confirmed."""

import json
from pathlib import Path
from typing import Any

import pytest

from falsifier import Candidate, Problem, Signal, confirm, evaluate, load_problem
from tests.systems.driving import ROOT

SPECS = [
    spec
    for folder in ("development", "held_out")
    for spec in sorted((ROOT / "bench" / folder).glob("*.toml"))
]
REQUIREMENTS = ("easy", "hard", "very_hard")


def witnesses(spec: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((spec.parent / "witnesses.json").read_text("utf-8"))[spec.stem]
    return found


def candidate(problem: Problem, witness: dict[str, Any]) -> Candidate:
    signals = {
        ranges.name: Signal.evenly(
            witness["inputs"][ranges.name],
            stop_time=problem.space.stop_time,
            interpolation=ranges.interpolation,
        )
        for ranges in problem.space.inputs
    }
    return problem.space.admit(Candidate(signals, witness.get("parameters", {})))


@pytest.mark.parametrize("requirement", REQUIREMENTS)
@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.stem)
def test_the_witness_lies_in_the_fixed_space_and_is_confirmed(spec: Path, requirement: str) -> None:
    problem = load_problem(f"{spec}:{requirement}", parameterization="fixed")
    witness = witnesses(spec)[requirement]
    found = evaluate(problem, candidate(problem, witness))
    assert found.robustness is not None and found.robustness < 0
    assert found.robustness == pytest.approx(witness["robustness"], rel=1e-3, abs=1e-6)
    assert confirm(problem, found).outcome == "confirmed"


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.stem)
def test_the_defaults_violate_nothing(spec: Path) -> None:
    for requirement in REQUIREMENTS:
        problem = load_problem(f"{spec}:{requirement}", parameterization="fixed")
        middle = problem.space.decode(problem.space.bounds.mean(axis=1))
        assert not evaluate(problem, middle).violated, requirement
