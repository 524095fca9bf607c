from falsifier.core.model import ModelInfo
from falsifier.fmu import stepper
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.description.slot import Slot
from falsifier.fmu.ports import make_ports
from tests.fmu import plain


def test_a_negated_alias_has_the_other_sign() -> None:
    info = ModelInfo("M", fmi_version="1.0")
    slots = {"a": Slot(0, "Real"), "b": Slot(0, "Real", negated=True)}
    ports = make_ports(Description(info, "", {}, slots), ["a", "b"], {"Real": 1})
    memory = ports.memory[1]
    memory[0] = 2.5
    loops, place = stepper.loops(), ports.table[2]
    assert [loops.fetch(place + 32 * k) for k in (0, 1)] == [2.5, -2.5]
    assert [plain.fetch(place + 32 * k) for k in (0, 1)] == [2.5, -2.5]
    loops.put(place + 32, 4.0)
    assert memory[0] == -4.0
