"""How a prompt reads, block by block; the words of whole prompts are test_variants.py's."""

from falsifier.llm.prompts import render
from falsifier.llm.prompts.blocks import (
    AdviceBlock,
    DimensionLine,
    HistoryBlock,
    InputLine,
    InputsBlock,
    OutputsBlock,
    ParameterLine,
    Prompt,
    ReplyBlock,
    RequirementBlock,
    SampleLines,
    SignalLine,
    SystemBlock,
    TaskBlock,
)

U = InputLine(
    name="u", low="-1", high="1", control_points=2, times=("0", "10"), interpolation="linear", unit="V"
)
BARE = Prompt(
    variant="MP1",
    task=TaskBlock(knows_requirement=False, is_published=True, count=1),
    inputs=InputsBlock(stop_time="10", dimensions=(DimensionLine(number=1, low="0", high="1"),)),
    reply=ReplyBlock(example='{"point": [0.5]}'),
)
FULL = BARE.model_copy(
    update={
        "task": TaskBlock(knows_requirement=True, count=1),
        "system": SystemBlock(name="lag", description="A lag."),
        "requirement": RequirementBlock(
            formula="G (x <= 1)", reading="reads", description="says", terms=("abs(x)",)
        ),
        "outputs": OutputsBlock(
            signals=(SignalLine(name="x", unit="m", description="position", kind="integer"),)
        ),
        "inputs": InputsBlock(
            stop_time="10", inputs=(U,), parameters=(ParameterLine(name="p", low="0", high="9", nominal="3"),)
        ),
        "advice": AdviceBlock(lines=("first advice", "second advice")),
        "reply": ReplyBlock(example="{}", notes=("a note on the form",)),
    }
)


def standing(prompt: Prompt) -> str:
    return render(prompt)[0].content


def changing(prompt: Prompt) -> str:
    return render(prompt)[1].content


def test_what_stays_goes_first_and_what_changes_last() -> None:
    assert [m.role for m in render(FULL)] == ["system", "user"]
    other = FULL.model_copy(update={"history": HistoryBlock(samples=(), notes=("news",))})
    assert standing(other) == standing(FULL), "so that providers can keep it"
    assert "news" in changing(other)


def test_blocks_come_in_order_with_an_empty_line_between_them() -> None:
    text = standing(FULL)
    places = [
        text.index(part)
        for part in (
            "lag. A lag.",
            "G (x <= 1)",
            "- x [m]",
            "- input signal u",
            "- parameter p",
            "first advice\nsecond advice",
            "{}\na note on the form",
        )
    ]
    assert places == sorted(places)
    assert len(text.split("\n\n")) == 7


def test_what_is_not_told_leaves_no_trace() -> None:
    assert len(standing(BARE).split("\n\n")) == 3
    for word in ("requirement", "Requirement", "signal", "System"):
        assert word not in standing(BARE)
    assert "1, from 0 to 1" in standing(BARE)


def test_a_requirement_is_followed_by_its_reading_description_and_terms() -> None:
    lines = standing(FULL).split("\n\n")[2].splitlines()
    assert lines[1] == "G (x <= 1)"
    assert [any(part in line for line in lines[2:]) for part in ("reads", "says", "abs(x)")] == [True] * 3


def test_signals_tell_unit_type_and_meaning() -> None:
    assert "- x [m], integer: position" in standing(FULL)
    plain = FULL.model_copy(
        update={"outputs": OutputsBlock(signals=(SignalLine(name="x"), SignalLine(name="y")))}
    )
    assert "x, y" in standing(plain)
    none = FULL.model_copy(update={"outputs": OutputsBlock(signals=())})
    assert "none" in standing(none)


def asked(**changes: object) -> str:
    inputs = InputsBlock(stop_time="10", inputs=(U.model_copy(update=changes),))
    return standing(FULL.model_copy(update={"inputs": inputs})).split("\n\n")[4].splitlines()[1]


def test_inputs_tell_range_control_points_hold_and_freedom() -> None:
    usual = asked()
    assert usual.startswith("- input signal u [V]; from -1 to 1; 2 control points at t = 0, 10 s; linear")
    assert asked(hold=0.05).startswith(usual) and asked(hold=0.05).endswith("0.05 s")
    assert "control points" not in asked(control_points=1, times=("0",))
    free = asked(max_control_points=9, min_interval=0.5)
    assert "9" in free and "0.5 s" in free and "pchip" in free
    whole = asked(max_control_points=9, min_interval=0.5, kind="integer", interpolation="constant")
    assert "pchip" not in whole and "integers from -1 to 1" in whole
    assert "1 = low, 2 = top" in asked(kind="enumeration", items=("1 = low", "2 = top"))
    assert "0 (false) or 1 (true)" in asked(kind="boolean")


def test_samples_show_their_mark_inputs_and_lines() -> None:
    samples = (
        SampleLines(
            number=2, mark="best", inputs=("u = 1", "v = 2"), robustness="-1", facts=("a",), details=("b",)
        ),
        SampleLines(number=3, inputs=("u = 3",), failure="no verdict"),
    )
    history = HistoryBlock(samples=samples, omitted=4, pending=("u = 9",), notes=("a note",))
    first, second, third, note, pending, ask = changing(FULL.model_copy(update={"history": history})).split(
        "\n\n"
    )
    assert "2 of 6" in first
    assert second.splitlines() == ["Sample 2 (best): u = 1; v = 2", "  robustness -1", "  a", "  b"]
    assert third.splitlines() == ["Sample 3: u = 3", "  no verdict"]
    assert note == "a note"
    assert pending.endswith("\nu = 9")
    assert "repeat" in ask


def test_as_many_as_wanted_are_asked_for() -> None:
    several = BARE.model_copy(update={"task": TaskBlock(knows_requirement=True, count=5)})
    assert "5 different" in standing(several) and "5 different" in changing(several)
    assert "different" not in standing(BARE) + changing(BARE)
