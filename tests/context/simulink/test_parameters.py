from falsifier.context.simulink.parameters import meaningful


def test_known_types_keep_what_carries_meaning() -> None:
    stated = {"Gain": "5", "Position": "[0, 0, 1, 1]", "SampleTime": "-1"}
    assert meaningful("Gain", stated, {}) == (("Gain", "5"),)
    assert meaningful("Switch", {"Criteria": "u2 > Threshold"}, {"Threshold": "0"}) == (
        ("Criteria", "u2 > Threshold"),
        ("Threshold", "0"),
    )


def test_limits_that_are_switched_off_are_not_told() -> None:
    limits = {"InitialCondition": "1", "UpperSaturationLimit": "3"}
    assert meaningful("Integrator", limits, {}) == (("InitialCondition", "1"),)
    on = dict(meaningful("Integrator", {**limits, "LimitOutput": "on"}, {}))
    assert on == {"InitialCondition": "1", "LimitOutput": "on", "UpperSaturationLimit": "3"}


def test_unknown_types_keep_all_but_how_they_are_drawn() -> None:
    stated = {"Position": "[1]", "MaskIconOpaque": "on", "uplimit": "3\n4", "empty": "[]"}
    assert meaningful("Reference", stated, {}) == (("uplimit", "3 4"),)


def test_long_values_say_how_long_they_are() -> None:
    ((_, value),) = meaningful("Constant", {"Value": "1 " * 2000}, {})
    assert value.endswith("(3,999 characters)")
    assert len(value) < 2100


def test_of_library_blocks_types_and_how_they_are_inherited_are_left_out() -> None:
    types = {f"{name}DataTypeStr": "Inherit: Inherit via internal rule" for name in ("P", "I", "D", "SumOut")}
    stated = {"Controller": "PI", "P": "5", "I": "0.2", **types, "PParamMin": "[]", "AccumMode": "Inherited"}
    assert dict(meaningful("Reference", stated, {})) == {"Controller": "PI", "P": "5", "I": "0.2"}
