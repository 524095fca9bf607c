"""What is read from replies, and the schema that asks for them."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings, strategies as st

from bench.replies import odd_replies, outcome
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.formalizing import readings_schema
from falsifier.llm.messages import ChatReply
from falsifier.llm.replies import ReplyForm

FREE = Freedom(max_control_points=200, min_interval=0.1)
SPACE = SearchSpace(
    (
        InputRange("throttle", 0.0, 100.0, control_points=3, interpolation="linear", hold=0.05, free=FREE),
        InputRange("brake", 0.0, 325.0, control_points=2, interpolation="constant", hold=None, free=None),
    ),
    (ParameterRange("mass", 900.0, 1100.0),),
    10.0,
)
GOOD = {
    "rationale": "full throttle",
    "signals": [{"name": "throttle", "values": [100, 50, 0]}, {"name": "brake", "values": [0, 325]}],
    "parameters": [{"name": "mass", "value": 1000}],
}


def form_of(*, free: bool = False, **form: Any) -> ReplyForm:
    return ReplyForm(SPACE if free else SPACE.fixed, **form)


def read(reply: Any, **form: Any) -> Any:
    text = reply if isinstance(reply, str) else json.dumps(reply)
    (candidate,) = form_of(**form).read(text, origin="me")
    return candidate


def test_signals_by_name() -> None:
    candidate = read(GOOD)
    assert candidate.signals["throttle"] == Signal((0, 5, 10), (100, 50, 0), "linear", 0.05)
    assert candidate.signals["brake"] == Signal((0, 5), (0, 325), "constant", None)
    assert candidate.parameters == {"mass": 1000}
    assert (candidate.origin, candidate.rationale) == ("me", "full throttle")


def test_numbers_in_order() -> None:
    assert read({"point": [100, 50, 0, 0, 325, 1000], "rationale": ""}).key == read(GOOD).key


def test_ranges_are_told_together_with_what_is_malformed_unknown_or_missing() -> None:
    uneven = {"name": "throttle", "times": [0, 5], "values": [1, 2, 3]}
    too_high = {"name": "brake", "values": [0, 400]}
    with pytest.raises(RejectedReplyError, match=r"2 times and 3 values.*'brake' at .*400 is outside"):
        read({"rationale": "", "signals": [uneven, too_high], "parameters": []})
    with pytest.raises(RejectedReplyError, match=r"'mas'.*'throttle' is m.*'mass' is m.*400 is out"):
        read({"rationale": "", "signals": [too_high], "parameters": [{"name": "mas", "value": 1}]})


def changed(**changes: Any) -> dict[str, Any]:
    return {**GOOD, **changes}


@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        ({"point": [1, 2, 3]}, "expected 6 numbers, got 3"),
        ({"point": [1, "two", 3, 4, 5, 6]}, "'two'"),
        ({"point": [0, 0, 0, 0, 0, 2000]}, r"'mass': 2000 is outside its range \[900, 1100\]"),
        ('{"point": [0, 0, 0, 0, 0, 1e999]}', "finite number"),
        (
            {"point": [-1, 0, 101, 0, 0, 2000]},
            r"'throttle' at t = 0, 10 s: -1, 101 are outside .*; parameter 'mass'",
        ),
        (
            changed(signals=[{"name": "throttle", "values": [101]}, GOOD["signals"][1]]),
            r"input 'throttle': 101 is outside its range \[0, 100\]$",
        ),
        (changed(signals=[{"name": "throttle", "values": []}, GOOD["signals"][1]]), "has no values"),
        (changed(signals=[{"name": "throttle", "values": ["lots"]}]), "'lots' is neither a number nor a run"),
        (changed(parameters=[{"name": "mass", "value": float("nan")}]), "finite"),
        (changed(parameters=[{"name": "mass", "value": v} for v in (950, 1050)]), "'mass' is given twice"),
        # All that is wrong at once, as each reply costs.
        (
            changed(signals=[{"name": "throttle", "values": []}, {"name": "brakes", "values": [0]}]),
            "'throttle' has no values; unknown input 'brakes'",
        ),
        (
            changed(signals=[{"name": n, "values": [0] * 7} for n in ("throttle", "brake")]),
            "'throttle': expected .*, got 7 .*; input 'brake': expected .*, got 7 ",
        ),
        (changed(signals=[], parameters=[]), "'brake' is missing; parameter 'mass' is missing"),
        ({"candidates": []}, "expected 'candidates' to be a list of objects, and not an empty one$"),
    ],
)
def test_what_is_wrong_is_told(reply: Any, problem: str) -> None:
    with pytest.raises(RejectedReplyError, match=problem):
        read(reply)


def throttle(**signal: Any) -> dict[str, Any]:
    return changed(signals=[{"name": "throttle", **signal}, GOOD["signals"][1]])


class TestFreeParameterization:
    @pytest.mark.parametrize(
        ("signal", "expected"),
        [
            ({"times": [], "values": [1, 2, 3, 4]}, Signal((0, 2.5, 5, 7.5), (1, 2, 3, 4), "constant", 0.05)),
            (
                {"times": [0, 2, 2.25], "values": [0, 100, 0]},
                Signal((0, 2, 2.25), (0, 100, 0), "constant", 0.05),
            ),
            ({"values": [[0, 100], [2.5, 0]]}, Signal((0, 2.5), (100, 0), "constant", 0.05)),
            ({"points": [[0, 100], [2.5, 0]]}, Signal((0, 2.5), (100, 0), "constant", 0.05)),
            ({"values": ["0 x 2", 100, "50*1"]}, Signal((0, 2.5, 5, 7.5), (0, 0, 100, 50), "constant", 0.05)),
        ],
    )
    def test_points_times_pairs_and_runs(self, signal: dict[str, Any], expected: Signal) -> None:
        found = read(throttle(interpolation="constant", **signal), free=True)
        assert found.signals["throttle"] == expected

    @pytest.mark.parametrize(
        ("signal", "problem"),
        [
            ({"times": [1, 2], "values": [3, 4]}, "increase strictly from 0, got 1.0 as the first"),
            ({"times": [0, 2], "values": [3]}, "2 times and 1 values"),
            ({"times": [0, 0.01], "values": [3, 4]}, "less than 0.1 s apart"),
            ({"times": [0, 11], "values": [3, 4]}, "after the stop time"),
            ({"values": ["1 x 201"]}, "at most 200"),
            ({"values": ["1 x 99999999999"]}, "longer than"),
            ({"interpolation": "spline", "values": [1]}, "pchip"),
        ],
    )
    def test_limits(self, signal: dict[str, Any], problem: str) -> None:
        with pytest.raises(RejectedReplyError, match=problem):
            read(throttle(**signal), free=True)

    def test_not_where_it_was_not_offered(self) -> None:
        with pytest.raises(RejectedReplyError, match="expected 3 evenly spaced"):
            read(throttle(interpolation="constant", times=[0, 2], values=[3, 4]))


def strict_subset(schema: dict[str, Any]) -> None:
    """Fail unless a strict server takes this schema, with limits or without."""
    if schema.get("type") == "object":
        assert schema["additionalProperties"] is False
        assert schema["required"] == list(schema["properties"])
        for part in schema["properties"].values():
            strict_subset(part)
    elif schema.get("type") == "array":
        assert set(schema) - {"minItems", "maxItems"} == {"type", "items"}
        strict_subset(schema["items"])
    else:  # no anyOf: OpenAI refuses objects in it that begin with the same key
        assert schema["type"] in ("string", "number", "integer")
        assert set(schema) - {"minimum", "maximum"} <= {"type", "enum"}


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("count", [1, 3])
def test_schema_is_in_the_strict_subset(named: bool, free: bool, count: int) -> None:
    for schema in (form_of(named=named, free=free, count=count).schema(), readings_schema()):
        assert schema["type"] == "object"
        strict_subset(schema)


def test_interpolations_are_those_that_are_possible() -> None:
    free = Freedom(50, 0.1)
    smooth, gear = InputRange("u", 0.0, 1.0, free=free), InputRange("g", 1.0, 4.0, free=free, kind="integer")

    def form(*inputs: InputRange) -> ReplyForm:
        return ReplyForm(SearchSpace(inputs, (), 10.0))

    def offered(form: ReplyForm) -> list[str]:
        schema = form.schema()
        strict_subset(schema)
        found: list[str] = schema["properties"]["signals"]["items"]["properties"]["interpolation"]["enum"]
        return found

    assert offered(form(gear)) == ["constant"]
    assert len(offered(form(smooth, gear))) == 3
    signals = [
        {"name": name, "interpolation": "linear", "times": [0, 5], "values": [1, last]}
        for name, last in (("u", 0), ("g", 2))
    ]
    with pytest.raises(RejectedReplyError, match=r"'g'.*constant"):
        form(smooth, gear).read(json.dumps({"rationale": "", "signals": signals}))


class TestSampleToReferTo:
    """What a reply leaves out is as in the sample that it names."""

    def form(self) -> ReplyForm:
        return form_of(
            free=True, samples=[read(GOOD), read(GOOD | {"parameters": [{"name": "mass", "value": 900}]})]
        )

    def test_the_rest_is_as_there(self) -> None:
        brake = [{"name": "brake", "values": [1, 2]}]
        (new,) = self.form().read(json.dumps({"rationale": "", "as_in": 2, "signals": brake}))
        assert new.signals["throttle"] == read(GOOD).signals["throttle"]
        assert (new.signals["brake"].values, new.parameters) == ((1.0, 2.0), {"mass": 900})

    @pytest.mark.parametrize(
        ("as_in", "told"),
        [
            (3, "no sample 3; the latest is 2"),
            (-1, "no sample -1"),
            (0, "'mass'"),
            (None, "'mass'"),
            ("x", "as_in"),
        ],
    )
    def test_without_such_a_sample_all_must_be_given(self, as_in: Any, told: str) -> None:
        with pytest.raises(RejectedReplyError, match=told):
            self.form().read(json.dumps({"as_in": as_in, "signals": GOOD["signals"]}))

    def test_if_nothing_is_left_out_the_number_does_not_matter(self) -> None:
        complete = (json.dumps(GOOD | {"as_in": number}) for number in (0, 3))
        assert len({candidate.key for text in complete for candidate in self.form().read(text)}) == 1

    def test_schema(self) -> None:
        schema = self.form().schema()
        strict_subset(schema)
        assert "as_in" in schema["properties"] and "minItems" not in schema["properties"]["signals"]


def discrete(door: Any = 0, on: Any = 0, gear: Any = 1, **reply: Any) -> Any:
    """Read values of an enumeration, a Boolean and an integer."""
    items = (("Open", 0), ("Lock", 2))
    kinds: dict[str, Any] = {"control_points": 2, "interpolation": "constant"}
    door_, on_ = (
        InputRange("door", 0.0, 2.0, kind="enumeration", items=items, **kinds),
        InputRange("on", 0.0, 1.0, kind="boolean", **kinds),
    )
    space = SearchSpace((door_, on_), (ParameterRange("gear", 1.0, 5.0, kind="integer"),), 10.0)
    signals = [{"name": "door", "values": door}, {"name": "on", "values": on}]
    reply = reply or {"signals": signals, "parameters": [{"name": "gear", "value": gear}]}
    (candidate,) = ReplyForm(space).read(json.dumps(reply), origin="me")
    return {n: list(s.values) for n, s in candidate.signals.items()} | dict(candidate.parameters)


@pytest.mark.parametrize(
    "reply",
    [
        {"door": ["Lock", "Open"], "on": ["true", False], "gear": 3.0},
        {"door": ["2", 0], "on": [True, "false"], "gear": "3"},
        {"door": [" LOCK", "open"], "on": ["True", "FALSE"], "gear": 3},
        {"door": ["2 = Lock", "0 = Open"], "on": ["1 = true", False], "gear": 3},
        {"signals": {"door": ["Lock", 0], "on": [[0, "true"], [5, 0]]}, "parameters": {"gear": 3}},
        {"point": [2, 0, True, False, 3]},
    ],
    ids=str,
)
def test_words_that_stand_for_numbers_are_read(reply: dict[str, Any]) -> None:
    assert discrete(**reply) == {"door": [2, 0], "on": [1, 0], "gear": 3}


@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        ({"door": ["look", 0]}, "door: 'look' is none of 'Open', 'Lock'"),
        ({"door": [True, 0]}, "door: 'true' is none of 'Open', 'Lock'"),
        ({"gear": True}, "gear: 'true' is no number"),
        ({"door": ["2 = Open", 0]}, "door: '2 = Open' is none of 'Open', 'Lock'"),
        ({"door": [{"value": 1}, 0]}, "signals.0.values"),
        ({"on": ["Lock", 0]}, "on: 'Lock' is none of 'false', 'true'"),
        ({"door": [1, 0]}, "input 'door': 1 is none of its numbers; the nearest is 0"),
        ({"on": [0.5, 0]}, "input 'on': 0.5 is no whole number; the nearest is 0"),
        ({"gear": 2.7}, "parameter 'gear': 2.7 is no whole number; the nearest is 3"),
        ({"gear": 5.3}, "parameter 'gear': 5.3 is no whole number; the nearest is 5"),
        ({"gear": 6}, "parameter 'gear': 6 is outside its range"),
        ({"point": [0, 0, 1, 0, True]}, "number 5: 'true' is no number"),
        (
            {"signals": [{"name": "on", "values": [1, 0], "times": [0, True]}]},
            "times.1 (of 'on'): Value error",
        ),
        ({"point": [0, 0, 0.4, 0, 1]}, "number 3: 0.4 is no whole number; the nearest is 0"),
        ({"signals": [{"name": "door", "values": [0, 2]}, 5]}, "signals.1: "),
        ({"signals": {"door": [None, 2], "on": [0, 1]}}, "signals.0.values.0 (of 'door'): "),
        ({"parameters": [{"name": "gear", "value": "fast"}]}, "parameters.0.value (of 'gear'): "),
        ({"signals": [{"name": "n" * 200, "values": [True]}]}, f"unknown input '{'n' * 64}' ..."),
    ],
    ids=str,
)
def test_values_that_cannot_be_taken_are_told(reply: dict[str, Any], problem: str) -> None:
    with pytest.raises(RejectedReplyError, match=re.escape(problem)):
        discrete(**reply)


def test_several_candidates() -> None:
    other = changed(parameters=[{"name": "mass", "value": 901}])
    found = form_of(count=2).read(json.dumps({"candidates": [GOOD, other]}))
    assert [c.parameters["mass"] for c in found] == [1000, 901]


def test_one_bad_candidate_among_several_costs_nothing_but_itself() -> None:
    bad = [changed(parameters=[{"name": "mass", "value": v}]) for v in (1, 2)]
    form = form_of(count=2)
    assert len(form.read(json.dumps({"candidates": [bad[0], GOOD]}))) == 1
    with pytest.raises(
        RejectedReplyError, match=r"candidate 1: .*: 1 is outside.*; candidate 2: .*: 2 is outside"
    ):
        form.read(json.dumps({"candidates": bad}))


def test_a_rationale_is_something_that_a_file_can_hold() -> None:
    candidate = read(json.dumps(changed(rationale="half a pair: \ud800" + 5000 * "x")))
    assert candidate.rationale.encode("utf-8").startswith(b"half a pair: ?x")
    assert len(candidate.rationale) <= 2000


keys = st.sampled_from(
    ["signals", "parameters", "point", "candidates", "name", "values", "times", "points", "rationale",
     "throttle", "brake", "mass", "value", "interpolation"]
)  # fmt: skip
anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.just(10**400) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=12,
)


def reads_or_tells(form: ReplyForm, text: str) -> None:
    try:
        found = form.read(text)
    except RejectedReplyError as rejection:
        assert str(rejection)
    else:
        assert found and all(SPACE.admit(c).key == c.key for c in found)


@settings(max_examples=100)
@given(st.dictionaries(keys, anything, max_size=4), st.booleans())
@example({"point": ["0\x1f"]}, False)
@example({"point": {}}, False)
@example({"point": [100, 0, 0, 0, 325, 1100]}, False)
def test_any_json_gives_candidates_or_says_what_is_wrong(reply: dict[str, Any], free: bool) -> None:
    reads_or_tells(form_of(free=free), json.dumps(reply))


@settings(max_examples=100)
@given(st.text(alphabet='{}[]":,0123456789.-+eEx <>/pointsignalk`\n\\', max_size=60))
def test_any_text_gives_candidates_or_says_what_is_wrong(text: str) -> None:
    reads_or_tells(form_of(), f'{text}{{"point": [{text}]}}')


def test_a_value_beyond_its_range_by_a_rounding_is_clamped() -> None:
    found = read({"point": [100.05, 0, -0.05, 0, 325, 1100.1]})
    assert found.key == read({"point": [100, 0, 0, 0, 325, 1100]}).key
    decades = ReplyForm(SearchSpace((), (ParameterRange("leak", 1e-6, 1.0, scale="log"),), 10.0))
    (clamped,) = decades.read('{"point": [9.9e-7]}', origin="me")
    assert clamped.parameters["leak"] == 1e-6
    with pytest.raises(RejectedReplyError, match="outside its range"):  # a rounding of the width of all
        decades.read('{"point": [0]}', origin="me")
    parameter = decades.schema()["properties"]["parameters"]["items"]["properties"]["value"]
    leak = decades.space.parameters[0]
    assert parameter == {"type": "number", "minimum": leak.at(-1e-3), "maximum": leak.at(1.001)}


ROWS = re.findall(
    r"^\| (.+?) \| ((?:read|rejected).*) \|$",
    Path(__file__).parents[2].joinpath("bench", "replies.md").read_text(),
    re.MULTILINE,
)


@pytest.mark.parametrize(
    ("name", "reply"), list(odd_replies()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_odd_replies_are_read_or_told_as_the_table_says(name: str, reply: ChatReply) -> None:
    assert outcome(reply).replace("|", "/") == dict(ROWS)[name]


def test_what_can_be_read_in_one_way_only_is_read_and_everything_else_told() -> None:
    assert len(ROWS) == len(list(odd_replies()))
    assert sum(came == "read" for _, came in ROWS) >= 27
    assert all(came == "read" or len(came) > len("rejected: ") for _, came in ROWS)
