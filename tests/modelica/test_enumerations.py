"""Enumerations: items by name in Modelica, numbers from 1 in both versions of FMI."""

from __future__ import annotations

import numpy as np
import pytest

from falsifier.core.model import Experiment, Interface
from falsifier.core.signals import Signal
from falsifier.fmu import FmuModel, read_info
from tests.modelica.conftest import Build
from tests.modelica.support import INTERFACES, opened

WAIT, UP, DOWN = 1.0, 2.0, 3.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_items_are_described(build: Build, fmi: int) -> None:
    info = read_info(build("Enumerated", fmi=fmi))
    variables = {v.name: v for v in info.variables}
    for name, start in (("command", WAIT), ("counted", UP), ("before", DOWN)):
        assert variables[name].kind == "enumeration"
        assert variables[name].literals == {"Wait": 1, "Up": 2, "Down": 3}
        assert variables[name].start == start
    assert "kept[1]" not in variables


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
def test_enumerations_as_inputs_parameters_and_states(build: Build, fmi: int, interface: Interface) -> None:
    command = Signal((0.0, 0.2, 0.4, 0.6, 0.8), (WAIT, UP, DOWN, UP, UP), "constant")
    outputs = ("count", "before", "code", "later", "gain[1]", "gain[2]", "gain[3]")
    model = FmuModel(build("Enumerated", fmi=fmi), interface=interface)
    for counted, expected in ((UP, [0, 1, 1, 2, 2]), (DOWN, [0, 0, 1, 1, 1])):
        found = model.simulate({"command": command}, {"counted": counted}, Experiment(1.0, 0.1, outputs))
        rows = np.column_stack([found[name] for name in outputs])[1::2]
        assert rows[:, 0].tolist() == expected
        assert rows[:, 1].tolist() == [DOWN, WAIT, UP, DOWN, DOWN]
        assert rows[:, 2].tolist() == [13, 21, 32, 23, 23]
        assert rows[:, 3].tolist() == [float(c > counted) for c in (WAIT, UP, DOWN, UP, UP)]
        assert rows[:, 4].tolist() == [0, 1, 1, 1, 1]
        # The algorithm keeps {Up, Down}, from the tick at 0.5 s on the command there and the item before it.
        assert rows[:, 5].tolist() == [0.5] * 5
        assert rows[:, 6].tolist() == [3, 3, 2, 2, 2]
    model.close()


def test_an_enumeration_without_a_start_value_begins_with_its_first_item(build: Build) -> None:
    with opened(build("Enumerated")) as [fmu]:
        assert fmu.variables["command"].start == "1"
        assert fmu.fmu.getInteger([fmu.variables["command"].valueReference]) == [1]
