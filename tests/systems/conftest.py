"""One loaded FMU per system for all tests of that system."""

from collections.abc import Iterator

import pytest

from tests.systems.driving import Driver, driver


@pytest.fixture(scope="module")
def fmu(request: pytest.FixtureRequest) -> Iterator[Driver]:
    """Return the bundled FMU of the system after which the test module is named."""
    system = request.module.__name__.rpartition("test_")[2].upper()
    with driver(system) as loaded:
        yield loaded
