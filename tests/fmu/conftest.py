"""Each test starts and ends without processes of FMUs."""

from collections.abc import Iterator

import pytest

from falsifier.fmu.process.registry import REGISTRY


@pytest.fixture(autouse=True)
def fresh_workers() -> Iterator[None]:
    yield
    REGISTRY.close()
