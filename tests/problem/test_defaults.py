from dataclasses import replace

import pytest

from falsifier.core.model import Interface, ModelInfo
from falsifier.problem.defaults import default_interface

INFO = ModelInfo("m")


@pytest.mark.parametrize(
    ("offered", "chosen"),
    [
        (("model-exchange", "co-simulation"), "co-simulation"),
        (("model-exchange",), "model-exchange"),
        ((), None),
    ],
)
def test_co_simulation_goes_first(offered: tuple[Interface, ...], chosen: str | None) -> None:
    assert default_interface(replace(INFO, interfaces=offered)) == chosen
