"""What is said in several places: which of them counts, and what must be said somewhere."""

import copy
import re
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.files import bundled
from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.fmu import System, read_info
from falsifier.problem.joining import Joined, join, join_formula, placed
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.ranges import search_space
from falsifier.problem.requirement import parse_requirement
from falsifier.problem.sections import InputSection, ModelChanges, ParameterSection, RequirementSection
from falsifier.problem.shorthand import changes_from, changes_from_options, options_from
from falsifier.problem.spec import parse_spec
from tests.fmu.fixtures import altered, path as fixture

SPEC: dict[str, Any] = {
    "model": {"fmu": "AT.fmu", "interface": "co-simulation", "stop_time": 40.0},
    "inputs": {"throttle": {"control_points": 7}, "brake": {"value": 0}},
    "parameters": {"finalDrive": {"range": [3.0, 3.5]}},
    "requirements": {
        "R": {"formula": "G[0,20] (speed <= 120)", "description": "slow"},
        "S": {
            "formula": "G[0,20] (speed <= 80)",
            "stop_time": 30.0,
            "inputs": {"throttle": {"range": [0, 50]}},
        },
    },
    "profiles": {
        "coarse": {"inputs": {"throttle": {"control_points": 2, "interpolation": "constant"}}},
        "own": {"stop_time": 40.0, "requirements": {"S": {"stop_time": 20.0}}},
    },
}
FILE = bundled("fmus") / "my.toml"


def joined(requirement: str = "R", *, options: dict[str, Any] | None = None, **more: Any) -> Joined:
    changes = changes_from_options(**options) if options else None
    return join(parse_spec(SPEC, file="my.toml"), requirement, path=FILE, changes=changes, **more)


def test_what_the_spec_says_is_completed_from_the_fmu() -> None:
    found = joined()
    (throttle,) = found.space.inputs
    assert (throttle.low, throttle.high, throttle.unit, throttle.control_points) == (0, 100, "%", 7)
    assert found.parameters == {"brake": 0.0}
    assert [(p.name, p.low, p.nominal) for p in found.space.parameters] == [("finalDrive", 3.0, 3.23)]
    assert (found.experiment.stop_time, found.experiment.output_interval) == (40.0, 0.01)
    assert (found.requirement.name, found.requirement.description) == ("R", "slow")


def test_a_parameter_may_be_searched_in_decades_and_nothing_else() -> None:
    def searched(**options: Any) -> list[tuple[str, float, str]]:
        found = joined(options=options).space.parameters
        return [(p.name, p.low, p.scale) for p in found]

    assert searched(ranges=["finalDrive=3:3.5:log"]) == [("finalDrive", 3.0, "log")]
    assert searched() == [("finalDrive", 3.0, "linear")]
    scaled = copy.deepcopy(SPEC)
    scaled["parameters"]["finalDrive"] = {"range": [3.0, 3.5], "scale": "log"}
    narrower = changes_from(parameters={"finalDrive": (3.1, 3.2)})
    (p,) = join(parse_spec(scaled, file="my.toml"), "R", path=FILE, changes=narrower).space.parameters
    assert (p.low, p.scale) == (3.1, "log")
    with pytest.raises(SpecError, match="throttle: is an input: only parameters can have a scale"):
        joined(options={"ranges": ["throttle=1:100:log"]})
    scaled["parameters"] = {"rollingLoad": {"range": [0, 40], "scale": "log"}}
    with pytest.raises(SpecError, match=r'parameters\.rollingLoad: .*scale "log" needs low > 0'):
        join(parse_spec(scaled, file="my.toml"), "R", path=FILE)


def test_requirement_then_profile_then_option_override_the_spec() -> None:
    narrowed = joined("S")
    assert (narrowed.space.inputs[0].high, narrowed.experiment.stop_time) == (50.0, 30.0)
    assert joined("S", profile="own").experiment.stop_time == 20.0
    coarse = joined("S", profile="coarse").space.inputs[0]
    assert (coarse.high, coarse.control_points, coarse.interpolation) == (50.0, 2, "constant")
    options = {"ranges": ["throttle=10:20:3"], "values": ["finalDrive=3.1"], "stop_time": 25.0}
    changed = joined("S", profile="coarse", options=options)
    assert [(r.low, r.high, r.control_points) for r in changed.space.inputs] == [(10.0, 20.0, 3)]
    assert changed.parameters == {"brake": 0.0, "finalDrive": 3.1}
    assert changed.space.parameters == ()
    assert changed.experiment.stop_time == 25.0


def test_a_stop_time_that_is_overridden_decides_no_grid() -> None:
    spec = copy.deepcopy(SPEC)
    spec["requirements"]["S"] = {"template": "stays_within", "signal": "speed", "high": 80}
    spec["requirements"]["S"]["stop_time"] = 3.14159
    found = join(parse_spec(spec, file="my.toml"), "S", path=FILE, changes=changes_from(stop_time=7.0))
    assert (str(found.requirement.formula), found.experiment.output_interval) == (
        "G[0,7] (speed <= 80)",
        0.01,
    )


def test_what_keeps_everything_constant_is_said_as_it_is() -> None:
    spec = copy.deepcopy(SPEC) | {"parameters": {}}
    spec["inputs"]["throttle"] = {"value": 3}
    with pytest.raises(SpecError, match="nothing to search: the spec keeps throttle and brake constant"):
        join(parse_spec(spec, file="my.toml"), "R", path=FILE)


def test_a_formula_of_ones_own_takes_the_requirements_place() -> None:
    found = joined(stated=RequirementSection(formula="F[0,20] (rpm > 3000)"))
    assert (found.requirement.name, found.requirement.description) == ("stl", "")
    assert found.requirement.formula.signals == ("rpm",)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"requirement": "T"}, "'T'"),
        ({"profile": "fine"}, "'fine'"),
        ({"stated": RequirementSection(formula="G[0,50] (speed <= 1)")}, "stl: "),
        ({"options": {"values": ["speed=3"]}}, "parameters.speed: cannot be set"),
        (
            {"options": {"values": ["throttle=3", "finalDrive=3"]}},
            "nothing to search: a value keeps throttle and finalDrive constant",
        ),
        ({"options": {"output_interval": 0.03}}, "output_interval: stop_time = 40 s is not"),
    ],
)
def test_what_does_not_fit_together_is_named(more: dict[str, Any], named: str) -> None:
    with pytest.raises(SpecError) as caught:
        joined(**more)
    assert named in str(caught.value)
    # The spec is named if it is to blame, or what is missing can be added to it.
    assert (str(FILE) in str(caught.value)) == (named in ("'T'", "'fine'") or named.startswith("nothing"))


@pytest.mark.parametrize(
    ("profile", "wrong", "key"),
    [
        (None, {"output_interval": 0.07}, "requirements.S.output_interval"),
        (None, {"omit": ["sped"]}, "requirements.S.omit"),
        (None, {"allow": ["all"]}, "requirements.S.allow"),
        (None, {"inputs": {"throttle": {"range": [0, 500]}}}, "requirements.S.inputs.throttle.range"),
        ("coarse", {"inputs": {"throttle": {"range": [0, 500]}}}, "requirements.S.inputs.throttle.range"),
        ("own", {"parameters": {"drive": 1}}, "profiles.own.requirements.S.parameters.drive"),
    ],
)
def test_what_is_wrong_is_named_where_it_is_stated(
    profile: str | None, wrong: dict[str, Any], key: str
) -> None:
    spec = copy.deepcopy(SPEC)
    (spec["profiles"]["own"] if profile == "own" else spec)["requirements"]["S"] |= wrong
    with pytest.raises(SpecError, match=rf"^{FILE}: {re.escape(key)}: "):
        join(parse_spec(spec, file="my.toml"), "S", path=FILE, profile=profile)


@pytest.mark.parametrize(
    ("section", "changes", "told"),
    [
        ("inputs", {"throttle": {"hold": 500.0}}, "hold: 500 s is longer than the simulation of 40 s; sh"),
        (
            "inputs",
            {"throttle": {"free": {"max_control_points": 3, "min_interval": 100.0}}},
            "min_interval: 100 s is longer than",
        ),
        (
            "inputs",
            {"throttle": {"control_points": 7, "free": {"max_control_points": 3, "min_interval": 1.0}}},
            r"inputs\.throttle: .*7 control points are more than free allows",
        ),
        ("model", {"record": ["sped"]}, r"model\.record: .*'speed'"),
        ("model", {"omit": ["sped"]}, r"model\.omit: no output 'sped'"),
    ],
)
def test_what_a_spec_says_must_fit_its_model(section: str, changes: dict[str, Any], told: str) -> None:
    spec = SPEC | {section: SPEC[section] | changes}
    with pytest.raises(SpecError, match=told):
        join(parse_spec(spec, file="my.toml"), "R", path=FILE)


def test_control_points_that_nobody_states_are_no_more_than_free_allows() -> None:
    spec = SPEC | {"inputs": {"throttle": {"free": {"max_control_points": 3, "min_interval": 1.0}}}}
    (throttle,) = join(parse_spec(spec, file="my.toml"), "R", path=FILE).space.inputs
    assert throttle.control_points == 3


def test_a_hold_that_is_shorter_than_a_step_is_noted() -> None:
    spec = SPEC | {"inputs": {"throttle": {"hold": 0.005}}}
    (note,) = [n for n in join(parse_spec(spec, file="my.toml"), "R", path=FILE).notes if "hold" in n]
    assert note == "throttle: hold = 0.005 s is shorter than the communication step, 0.01 s"


@pytest.mark.parametrize(
    ("points", "interface"), [(10_000, "co-simulation"), (7, "co-simulation"), (10_000, "model-exchange")]
)
def test_control_points_that_are_closer_than_steps_are_noted(points: int, interface: str) -> None:
    model, inputs = SPEC["model"] | {"interface": interface}, {"throttle": {"control_points": points}}
    joined = join(parse_spec(SPEC | {"model": model, "inputs": inputs}, file="my.toml"), "R", path=FILE)
    told = [n for n in joined.notes if "s apart are closer than the communication step, 0.01 s" in n]
    assert len(told) == (points > 7 and interface == "co-simulation"), "a solver sees all of them"


def test_a_range_that_may_be_in_the_displayed_unit_is_noted(tmp_path: Path) -> None:
    old, new = b'unit="m" start="1.0"', b'unit="m" displayUnit="mm" start="1.0"'
    ball = altered(fixture("Ball_2"), tmp_path / "ball.fmu", lambda text: text.replace(old, new))
    note = "h: its start value, 1 m, is outside the range; all numbers are in m"
    for high, told in ((1, []), (0.5, [note])):
        changes = changes_from(parameters={"h": (0, high)})
        found = join_formula(ball, RequirementSection(formula="G (h <= 9)"), changes=changes).notes
        assert [n.partition(", not")[0] for n in found if "outside" in n] == told


def test_a_value_that_may_be_in_the_displayed_unit_is_noted(tmp_path: Path) -> None:
    old, new = b'unit="m" start="1.0"', b'unit="K" displayUnit="degC" start="293.15"'
    ball = altered(fixture("Ball_2"), tmp_path / "ball.fmu", lambda text: text.replace(old, new))
    differences = altered(
        ball, tmp_path / "d.fmu", lambda x: x.replace(new, new + b' relativeQuantity="true"')
    )
    note = "h: 20 degC would be nearer to its start value, 293.15 K; all numbers are in K, not in degC"
    for value, fmu, told in ((300, ball, []), (350, ball, []), (20, ball, [note]), (20, differences, [])):
        changes = changes_from(parameters={"h": value})
        found = join_formula(fmu, RequirementSection(formula="G (h <= 9)"), changes=changes, searches=False)
        assert [n.partition(", in which")[0] for n in found.notes if "degC" in n] == told


def test_a_start_value_outside_of_the_model_s_own_limits_can_be_stated_again() -> None:
    h = Variable("h", causality="parameter", low=2.0, high=5.0, start=1.0, settable=True)
    for value in (1.0, 1.5):
        given = changes_from(parameters={"h": value})
        space = partial(search_space, {}, given.parameters, ModelInfo("M", variables=(h,)), 1.0, given)
        if value == h.start:
            assert space()[1] == {"h": 1.0}
        else:
            with pytest.raises(SpecError, match=r"1\.5 exceeds the model's limits for 'h', \[2, 5\]"):
                space()


def test_inputs_that_need_only_be_named_are_told() -> None:
    spec = {key: SPEC[key] for key in ("model", "requirements")}
    with pytest.raises(SpecError, match="throttle and brake would be searched between min and max if"):
        join(parse_spec(spec, file="my.toml"), "R", path=FILE)


@pytest.mark.parametrize("requirement", ["R", "S"])
def test_a_step_that_does_not_divide_the_interval_is_refused_with_its_key(requirement: str) -> None:
    spec = SPEC | {"model": SPEC["model"] | {"output_interval": 0.01, "step_size": 0.02}}
    with pytest.raises(SpecError, match=r"my\.toml: model\.step_size: .* try step_size = 0\.01"):
        join(parse_spec(spec, file="my.toml"), requirement, path=FILE)


def test_outputs_may_be_left_out_unless_the_formula_names_them() -> None:
    def recorded(*omit: str) -> set[str]:
        problem = Problem.from_fmu(fixture("Echo_2"), "G[0,1] (out_Real <= 1)", omit=omit)
        return set(problem.experiment.outputs)

    assert recorded() - recorded("out_Integer", "out_Real") == {"out_Integer"}
    with pytest.raises(SpecError, match=r"omit: no output 'out_Int'; did you mean 'out_Integer'"):
        recorded("out_Int")


def test_searches_record_states_and_modes_that_are_no_outputs_where_a_requirement_has_few_values() -> None:
    def internals(formula: str, *omit: str) -> tuple[str, ...]:
        return Problem.from_fmu(bundled("fmus") / "CC.fmu", formula, omit=omit).internals

    modes = ("car2.mode", "car3.mode", "car4.mode")
    found = internals("G[0,100] (car5.mode <= 2)")
    assert found[:3] == ("v1", "car2.y", "car2.v") and found[-3:] == modes
    assert internals("G[0,100] (car5.mode <= 2)", "v1", "car2.mode") == (*found[1:-3], *modes[1:])
    assert internals("G[0,100] (y5 - y4 <= 40)") == internals("G[0,9] (car5.mode <= 2 and y1 <= 9)") == ()
    # An output whose start value is given is continuous, too; what is connected is an output's copy.
    assert load_problem("CCcars1").internals == ()
    assert load_problem("ATsplit51").internals == ("car.engine", "car.wheel")
    chase = Problem.from_fmu(bundled("fmus") / "CC.fmu", "G[0,100] (car5.mode <= 2)")
    slope = chase.with_requirement("G[0,100] (y5 - y4 <= 40)")
    assert slope.internals == () and slope.with_requirement("G (car5.mode <= 2)").internals == found


def test_items_of_enumerations_may_be_named() -> None:
    def kept(said: str) -> list[tuple[str, float]]:
        changes = changes_from_options(values=[f"in_Enumeration={said}"])
        stated = RequirementSection(formula="G[0,1] (out_Real <= 1)")
        joined = join_formula(fixture("Echo_2"), stated, changes=changes)
        return list(joined.parameters.items())

    (first, number), *_ = read_info(fixture("Echo_2"))["in_Enumeration"].literals.items()
    assert kept(first) == kept(str(number)) == [("in_Enumeration", number)]
    with pytest.raises(SpecError, match=f"expected a number or one of {first}, .*, got 'nothing'"):
        kept("nothing")
    for name in (first, f"Kind.{first}"):
        with pytest.raises(SpecError, match=f"unknown signal '{name}'; .*: {first} is {number} of in_Enum"):
            Problem.from_fmu(fixture("Echo_2"), f"G (in_Enumeration == {name})")
    car = ModelInfo("car", variables=(Variable("car.v"), Variable("place", literals={"front": 1})))
    with pytest.raises(SpecError, match=r"unknown signal 'car.front'; (did|known)"):
        parse_requirement("car.front <= 1", car, Experiment(1.0, 0.5, ("car.v",)))


def test_every_kind_of_input_with_a_known_range_is_searched_and_of_the_others_the_reason_is_told(
    tmp_path: Path,
) -> None:
    problem = Problem.from_fmu(fixture("Echo_2"), "G[0,1] (out_Real <= 1)")
    assert [r.name for r in problem.space.inputs] == ["in_Boolean", "in_Enumeration"]
    why = "no range is given, and the FMU specifies no min and max"
    assert [(h.name, h.value, h.reason) for h in problem.held_inputs] == [
        ("in_Real", 0.0, why),
        ("in_Integer", 0.0, why),
    ]
    old, new = b'<Integer start="0"/>', b'<Integer start="0" min="0" max="5"/>'
    fmu = altered(fixture("Echo_2"), tmp_path / "Protocol.fmu", lambda content: content.replace(old, new, 1))
    problem = Problem.from_fmu(fmu, "G[0,1] (out_Real <= 1)")
    found = {r.name: (r.low, r.high, r.kind, r.interpolation) for r in problem.space.inputs}
    assert found["in_Integer"] == (0, 5, "integer", "constant")
    chosen = Problem.from_fmu(fmu, "G[0,1] (out_Real <= 1)", inputs={"in_Real": (0, 1), "in_Boolean": 1.0})
    held = {h.name: (h.value, h.reason) for h in chosen.held}
    assert held["in_Integer"] == (0.0, "not named beside what is searched; range 0 to 5")
    assert held["in_Boolean"] == (1.0, "its value is given")


def test_an_fmu_without_inputs_says_what_to_give(tmp_path: Path) -> None:
    low = RequirementSection(formula="G[0,1] (h >= -9)")
    with pytest.raises(SpecError, match=r"add parameters=\{'NAME': \(LOW, HIGH\)\}, .* known: g, e, h"):
        join_formula(fixture("Ball_2"), low, changes=changes_from_options(stop_time=1.0))
    with pytest.raises(SpecError, match=r"gone\.fmu"):
        join_formula(tmp_path / "gone.fmu", low, changes=changes_from_options())


def test_items_and_truth_values_are_given_by_their_names() -> None:
    items = {"Off": 1, "On": 7}
    kinds: list[Variable] = [
        Variable("mode", "enumeration", "input", literals=items),
        Variable("flag", "boolean", "parameter", settable=True),
    ]
    info = ModelInfo("m", variables=tuple(kinds))
    inputs = {"mode": InputSection(value="On")}
    for word in ("True", True):
        parameters = {"flag": ParameterSection.model_validate({"value": word})}
        assert search_space(inputs, parameters, info, 1.0, ModelChanges())[1] == {"mode": 7, "flag": 1}
    (mode,) = search_space({"mode": InputSection(range=("Off", 7))}, {}, info, 1.0, ModelChanges())[0].inputs
    assert (mode.low, mode.high) == (1, 7)
    high = {"flag": InputSection.model_validate({"range": [0, 2**53 + 1]})}
    with pytest.raises(SpecError, match=r"exceeds the integers that doubles .* \[-9007199254740991, 9007"):
        search_space(
            high, {}, ModelInfo("m", variables=(Variable("flag", "integer", "input"),)), 1.0, ModelChanges()
        )
    for wrong, message in (
        ({"value": "on"}, r"mode\.value: .*one of Off, On, got 'on'"),
        ({"value": "7:8"}, "got '7:8'; to search a range"),
        ({"value": True}, "one of Off, On, got 'true'"),
        ({"range": ("Off", "on")}, r"mode\.range: .*one of Off, On, got 'on'$"),
        ({"range": ("On", "Off")}, r"expected \[low, high\] with low < high, got \[7, 1\]"),
    ):
        section = {"mode": InputSection.model_validate(wrong)}
        with pytest.raises(SpecError, match=message):
            search_space(section, {}, info, 1.0, ModelChanges())


def test_what_belongs_to_a_clock_that_never_ticks_cannot_be_required() -> None:
    info = ModelInfo("m", variables=(Variable("sampled", causality="output", is_clocked=True),))
    with pytest.raises(
        SpecError, match=r"'sampled' changes only when a clock ticks, .* name a variable without"
    ):
        parse_requirement("G (sampled > 1)", info, Experiment(1.0, 0.1, ()))
    problem = Problem.from_fmu(fixture("ClocksAndBinary_3"), "G (y <= 1)")
    with pytest.raises(SpecError, match="stl: 'sampled' changes only when a clock ticks"):
        problem.with_requirement("G (sampled > 1)")
    model = {"fmu": str(fixture("ClocksAndBinary_3")), "record": ["sampled"]}
    stated = {"inputs": {"u": {"range": [0, 1]}}, "requirements": {"R": {"formula": "G (y <= 1)"}}}
    with pytest.raises(SpecError, match=r"model\.record: 'sampled' changes only when a clock ticks"):
        join(parse_spec({"model": model} | stated, file="my.toml"), "R", path=FILE)


def test_too_short_a_stop_time_is_not_blamed_on_the_interval() -> None:
    with pytest.raises(SpecError, match=r"^stop_time: stop_time = 1e-11 s is so short"):
        Problem.from_fmu(fixture("Lag_2"), "G (y <= 1)", stop_time=1e-11, output_interval=0.1)


def test_strings_are_no_numbers() -> None:
    variables = Variable("out", "string", "output"), Variable("in", "string", "input"), Variable("x")
    info = ModelInfo("m", variables=variables)
    with pytest.raises(SpecError, match="'out' is a string; only numbers can be recorded and compared"):
        parse_requirement("G (out > 1)", info, Experiment(1.0, 0.1, ()))
    for stated in ({"value": 1}, {"range": [0, 1]}):
        section = {"in": InputSection.model_validate(stated)}
        with pytest.raises(SpecError, match="this input is a string; it keeps its start value"):
            search_space(section, {}, info, 1.0, ModelChanges())
    named = Variable("text", "string", "parameter", settable=True), Variable("a=b", settable=True)
    text = placed(changes_from_options(ranges=["text"]), ModelInfo("m", variables=named))
    with pytest.raises(SpecError, match="'text' is a string; only numbers can be searched"):
        search_space({}, text.parameters, ModelInfo("m", variables=named), 1.0, text)
    with pytest.raises(
        SpecError, match=r"no input, .* 'a'; write \[inputs.NAME\] or .* with 'a=b' in a spec"
    ):
        placed(changes_from_options(ranges=["a=b=0:1"]), ModelInfo("m", variables=named))
    changes = placed(changes_from_options(values=["in=boom"]), info)
    with pytest.raises(SpecError, match=r"^inputs\.in: this input is a string"):
        search_space(changes.inputs, {}, info, 1.0, changes)


def test_a_parameter_without_a_range_has_that_of_the_fmu() -> None:
    mode = Variable("mode", "enumeration", "parameter", literals={"Off": 1, "On": 7}, settable=True)
    mass = Variable("mass", causality="parameter", low=900.0, high=1100.0, settable=True)
    info = ModelInfo("m", variables=(mode, mass, Variable("x", settable=True)))
    changes = placed(changes_from_options(ranges=["mode", "mass"]), info)
    assert changes == placed(changes_from(parameters={"mode": None, "mass": None}), info)
    space, _ = search_space({}, changes.parameters, info, 1.0, changes)
    assert [(r.low, r.high) for r in space.parameters] == [(1, 7), (900, 1100)]
    with pytest.raises(SpecError, match="specifies no min and max for this parameter; add its range"):
        search_space({}, {"x": ParameterSection()}, info, 1.0, ModelChanges())


def test_a_string_keeps_the_text_that_was_typed_and_a_number_may_be_typed_in_any_form() -> None:
    texts = (Variable(name, "string", "parameter", settable=True) for name in ("label", "note"))
    info = ModelInfo("m", variables=(*texts, Variable("mass", settable=True)))
    changes = changes_from_options(values=["label=007", "note=nan", "mass=1.50e3"])
    found = placed(changes, info).parameters
    assert [section.value for section in found.values()] == ["007", "nan", 1500.0]
    assert options_from(changes) == [("--set", text) for text in ("label=007", "note=nan", "mass=1.50e3")]


def test_the_time_is_told_by_windows() -> None:
    for name in ("time", "t"):
        with pytest.raises(
            SpecError, match=rf"unknown signal '{name}'; times are stated by windows: G\[3,5\]"
        ):
            Problem.from_fmu(fixture("Echo_2"), f"G ({name} > 3 -> out_Real <= 1)")


def test_derivatives_of_components_are_named_like_their_other_variables() -> None:
    info = System({"p": fixture("Plant_2")}).info
    experiment = Experiment(1.0, 0.1, ())
    assert parse_requirement("G (p.der(x) <= 1)", info, experiment).signals == ("p.der(x)",)
    with pytest.raises(SpecError, match=r"unknown signal 'der\(p\.x\)'; did you mean 'p\.der\(x\)'\?"):
        parse_requirement("G (der(p.x) <= 1)", info, experiment)
    with pytest.raises(SpecError, match="use the template ramp_limit"):
        parse_requirement("G (der(p.y) <= 1)", info, experiment)
