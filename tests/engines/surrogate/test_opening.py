from falsifier.engines.surrogate import Settings
from falsifier.engines.surrogate.opening import opening


def test_opening_follows_the_form_of_the_requirement() -> None:
    settings = Settings()
    plain = opening(settings, has_inputs=True, windows=(), needs_several=False)
    assert plain == ("constant", "constant")
    nested = opening(settings, has_inputs=True, windows=(2.0,), needs_several=True)
    assert nested == ("switching", "constant", "switching", "constant")
    joint = opening(settings, has_inputs=True, windows=(), needs_several=True)
    assert joint == ("stepping", "stepping")
    assert opening(settings, has_inputs=False, windows=(), needs_several=True) == ()
