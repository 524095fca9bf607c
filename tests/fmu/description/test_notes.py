from xml.etree import ElementTree

from falsifier.core.model import Variable
from falsifier.fmu.description.notes import needed_tool_text, notes
from falsifier.fmu.description.variables import Slot, with_aliases_marked

ROOT = ElementTree.fromstring("<fmiModelDescription><ModelVariables/></fmiModelDescription>")


def test_one_reference_has_one_name_that_can_be_set_and_an_input_keeps_its_own() -> None:
    variables = (
        Variable("start.u", settable=True),
        Variable("u", causality="input", settable=True),
        Variable("y", causality="output"),
        Variable("y2", causality="output"),
    )
    slots = {"start.u": Slot(1, "Real"), "u": Slot(1, "Real"), "y": Slot(2, "Real"), "y2": Slot(2, "Real")}
    marked, changed = with_aliases_marked(variables, slots)
    assert [(v.name, v.alias_of, v.settable) for v in marked] == [
        ("start.u", "u", False),
        ("u", "", True),
        ("y", "", False),
        ("y2", "", False),
    ]
    assert changed["start.u"].refusal == "it is another name of 'u'; set that one"


def test_many_names_are_counted_instead_of_listed() -> None:
    clocked = tuple(Variable(f"c{k}", is_clocked=True) for k in range(12))
    (said,) = notes(ROOT, clocked, start_time=0.0, tool="", needs_tool=())
    assert said.endswith("c8, c9 and 2 more")


def test_a_needed_tool_is_named_if_it_is_known() -> None:
    assert "(Tool 1)" in needed_tool_text("Tool 1", ("co-simulation",))
    assert "()" not in needed_tool_text("", ("co-simulation",))


def test_times_of_the_default_experiment_that_no_simulation_can_use_are_named() -> None:
    root = ElementTree.fromstring(
        '<fmi><DefaultExperiment startTime="0" stopTime="-1" stepSize="0" tolerance="1e-6"/></fmi>'
    )
    (said,) = notes(root, (), start_time=0.0, tool="", needs_tool=())
    assert said == "ignored in the default experiment, as not greater than 0: stopTime = -1, stepSize = 0"
