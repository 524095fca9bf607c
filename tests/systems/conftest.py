"""One loaded FMU per system for all tests of that system."""

from collections.abc import Iterator

import pytest

from falsifier.fmu import FmuModel
from tests.systems.driving import ROOT, Driver


@pytest.fixture(scope="module")
def fmu(request: pytest.FixtureRequest) -> Iterator[Driver]:
    """Return the bundled FMU of the system after which the test module is named."""
    system = request.module.__name__.rpartition("test_")[2].upper()
    model = FmuModel(ROOT / "fmus" / f"{system}.fmu", interface="co-simulation")
    yield Driver(model)
    model.close()
