"""One loaded FMU per system for all tests of that system."""

from collections.abc import Iterator

import pytest

from falsifier.fmu import FmuModel
from tests.systems.driving import ROOT, Driver


@pytest.fixture(scope="module")
def fmu(request: pytest.FixtureRequest) -> Iterator[Driver]:
    """Return the bundled FMU of the system after which the test module is named."""
    name = request.module.__name__.rpartition("test_")[2].replace("_", "")
    [path] = [path for path in (ROOT / "fmus").glob("*.fmu") if path.stem.lower() == name]
    model = FmuModel(path, interface="co-simulation")
    yield Driver(model)
    model.close()
