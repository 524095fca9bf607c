import pytest

from falsifier.campaigns import suite
from falsifier.errors import SpecError
from falsifier.problem.loading import load_source


def test_the_suite_has_the_published_requirements() -> None:
    names = [r.target for r in suite("arch-comp")]
    assert len(names) == 21
    assert {"AT:AT1", "AT:AT6abc", "NN:NN", "CC:CCx", "F16:F16", "SC:SC"} < set(names)
    assert [load_source(s).name for s in suite("arch-comp")] == [name.split(":")[1] for name in names]


def test_instance_2_leaves_out_what_has_none() -> None:
    names = [r.target for r in suite("arch-comp", profile="instance2")]
    assert "F16:F16" not in names
    assert len(names) == 20


def test_an_unknown_suite_is_named() -> None:
    with pytest.raises(SpecError, match="arch-comp"):
        suite("archcomp")
