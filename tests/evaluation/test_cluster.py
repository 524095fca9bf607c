"""The executor over a Dask cluster: its client here ends tasks in all ways; test_workers has a real one."""

import asyncio
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from types import SimpleNamespace
from typing import Any

import pytest

from falsifier.errors import ModelError
from falsifier.evaluation.workers import ClusterExecutor


class Client:
    """A client whose tasks end at once, by calling the function, or are given up."""

    def __init__(self, *, workers: int = 2) -> None:
        self.status = "running"
        self.given_up: list[Any] = []
        self.workers: dict[str, Any] = {"workers": {str(i): {} for i in range(workers)}}
        self.loop = SimpleNamespace(add_callback=lambda settle, *args: asyncio.run(settle(*args)))

    def submit(self, function: Callable[..., Any], *args: Any, pure: bool) -> Any:
        assert not pure

        async def task() -> Any:
            return function(*args)

        return task()

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        assert n_workers == -1
        return self.workers

    def cancel(self, tasks: list[Any]) -> None:
        self.given_up += tasks


def give_up() -> None:
    raise asyncio.CancelledError


def test_every_task_ends_as_the_cluster_says() -> None:
    executor = ClusterExecutor(Client(), "dask:tcp://here:1")
    assert executor.submit(lambda a: 2 * a, 21).result(0) == 42
    with pytest.raises(ZeroDivisionError):
        executor.submit(lambda: 1 // 0).result(0)
    with pytest.raises(BrokenExecutor, match="given up"):
        executor.submit(give_up).result(0)


def test_a_scheduler_that_has_gone_is_named() -> None:
    client = Client()
    executor = ClusterExecutor(client, "dask:tcp://here:1")
    assert executor.slots() == 2
    client.workers = {}
    assert executor.slots() == 0, "while the connection is made again"
    client.status = "closed"
    for use in (executor.slots, lambda: executor.submit(give_up)):
        with pytest.raises(ModelError, match=r"dask:tcp://here:1: .* has gone; .*falsifier resume"):
            use()


def test_tasks_under_way_are_given_up_on_request() -> None:
    client = Client()
    client.loop.add_callback = lambda *_: None  # nothing ends
    executor = ClusterExecutor(client, "dask:tcp://here:1")
    executor.submit(give_up)
    executor.shutdown(wait=False, cancel_futures=True)
    (task,) = client.given_up
    task.close()
