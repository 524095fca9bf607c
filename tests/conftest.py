"""What all tests share: no key and no address of an LLM in the environment, no network, an own cache."""

import gc
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from falsifier.campaigns import run_campaign
from falsifier.core.files import cache_directory
from falsifier.errors import speak_to
from tests import forking
from tests.campaigns.support import request, work_in_threads

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command line does

# How long an example takes on a busy machine says nothing about the property.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

# Their tests take longest. Started last, one of them would run while the other processes have nothing to do.
_FIRST = ("test_notebooks.py", "test_docs.py", "test_packaging.py", "test_kill.py")
# Those outside tests/llm that have litellm imported, in seconds: one process then does for all.
_WITH_LITELLM = ("test_formalize.py", "test_llm.py")

_real_connect = socket.socket.connect


def _guarded_connect(self: socket.socket, address: Any) -> None:
    if self.family in (socket.AF_INET, socket.AF_INET6) and address[0] not in (
        "127.0.0.1",
        "::1",
        "localhost",
    ):
        raise AssertionError(f"a test tried to reach {address[0]}")
    _real_connect(self, address)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Give the processes of pytest-xdist one server that forks."""
    node.workerinput["forks"] = forking.address()


def pytest_configure(config: pytest.Config) -> None:
    forking.given = getattr(config, "workerinput", {}).get("forks")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let long tests start first, and those that import litellm stand together."""

    def place(item: pytest.Item) -> tuple[bool, str]:
        folder = item.path.relative_to(Path(__file__).parent).parts[0]
        return item.path.name not in _FIRST, "llm" if item.path.name in _WITH_LITELLM else folder

    items.sort(key=place)


@pytest.fixture(autouse=True, scope="session")
def closed_network() -> Any:
    patch = pytest.MonkeyPatch()
    patch.setattr(socket.socket, "connect", _guarded_connect)
    for name in [n for n in os.environ if n.endswith(("_API_KEY", "_TOKEN", "_API_BASE", "_BASE_URL"))]:
        patch.delenv(name)
    yield
    patch.undo()


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the user's cache of falsifier as it is; what takes other tools long to make again is shared."""
    users, own = cache_directory().parent, tmp_path_factory.mktemp("cache")
    for name in ("fontconfig", "matplotlib", "pip", "zig"):
        with suppress(OSError):
            (users / name).mkdir(parents=True, exist_ok=True)
        (own / name).symlink_to(users / name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(own))
        yield


@pytest.fixture
def at_the_command_line() -> Iterator[None]:
    """Messages name options."""
    speak_to("command line")
    yield
    speak_to("Python")


@pytest.fixture
def stoppable() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, whoever runs the tests; callbacks of hypothesis would lose it."""
    callbacks = gc.callbacks[:]
    gc.callbacks.clear()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
    gc.callbacks.extend(callbacks)


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two requirements, one that is falsified and one that is not, two engines, two seeds."""
    directory = tmp_path_factory.mktemp("campaigns") / "nightly"
    with pytest.MonkeyPatch.context() as patch:
        work_in_threads(patch)
        run_campaign(request("hard", "impossible", engines=("uniform", "corners")), directory)
    return directory
