"""Tasks on a Dask cluster, as an executor whose futures always end.

Dask's own executor loses a future if its result cannot be fetched: a worker may die after it has finished a
task and before the result has left it, and the repetition may fail.
"""

from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager
from typing import Any

from falsifier.core.secrets import holds_credentials
from falsifier.errors import ModelError, SpecError

# Maximum time in s to wait for a cluster's scheduler.
_CONNECT_TIMEOUT = 20


class ClusterExecutor(Executor):
    """Runs functions on the workers of a cluster.

    Args:
        client: the cluster's client, a ``distributed.Client``.
        cluster: the address that the user gave.
    """

    def __init__(self, client: Any, cluster: str) -> None:
        self._client, self._cluster = client, cluster
        self._asked: dict[Future[Any], Any] = {}

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function on one of the workers; if a worker dies, the cluster tries others.

        Raises:
            ModelError: if the scheduler has gone.
        """
        self.check()
        # The same call again is another call: what it does may depend on more than its arguments.
        asked = self._client.submit(fn, *args, pure=False, **kwargs)
        promised: Future[Any] = Future()
        promised.set_running_or_notify_cancel()
        self._asked[promised] = asked
        promised.add_done_callback(lambda done: self._asked.pop(done, None))
        self._client.loop.add_callback(_settle, asked, promised)
        return promised

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: FBT001, FBT002 -- as in Executor
        """Give up the tasks that have not ended; with ``wait``, wait for them instead."""
        unfinished = dict(self._asked)
        if wait and not cancel_futures:
            for promised in unfinished:
                promised.exception()
        elif self._client.status == "running":
            self._client.cancel(list(unfinished.values()))

    def slots(self) -> int:
        """Return the number of workers that the cluster has at present, as far as is known.

        Raises:
            ModelError: if the scheduler has gone.
        """
        self.check()
        return len(self._client.scheduler_info(n_workers=-1).get("workers", ()))

    def check(self) -> None:
        """Check that there still is a connection to the scheduler; while it is made again, there is.

        Raises:
            ModelError: if it could not be made again.
        """
        if self._client.status in ("closing", "closed"):
            raise ModelError(
                f"--executor {self._cluster}: the Dask scheduler there has gone; what the runs have recorded "
                "is kept, and falsifier resume goes on from there"
            )


@contextmanager
def connected(cluster: str) -> Iterator[ClusterExecutor]:
    """Connect to a cluster.

    Args:
        cluster: ``dask:tcp://HOST:PORT``, the address of a Dask scheduler.

    Raises:
        SpecError: if this is not such an address, or Dask is not installed.
        ModelError: if the scheduler cannot be reached.
    """
    if holds_credentials(cluster):
        raise SpecError(
            "--executor: expected dask:tcp://HOST:PORT without a user name and a password, which Dask does "
            "not take; certificates are stated in Dask's own configuration"
        )
    kind, _, address = cluster.partition(":")
    if kind != "dask" or not address:
        raise SpecError(f"--executor {cluster}: expected dask:tcp://HOST:PORT")
    try:
        from distributed import Client
    except ImportError:
        raise SpecError(
            f"--executor {cluster}: Dask is not installed; install it with pip install 'falsifier[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=_CONNECT_TIMEOUT)
    except (OSError, ValueError) as error:
        raise ModelError(f"--executor {cluster}: cannot reach a Dask scheduler there: {error}") from None
    with client:
        yield ClusterExecutor(client, cluster)


async def _settle(asked: Awaitable[Any], promised: "Future[Any]") -> None:
    """Wait for a task of the cluster and hand over how it ended, whatever that is."""
    import asyncio

    try:
        result = await asked
    except (asyncio.CancelledError, CancelledError):
        promised.set_exception(BrokenExecutor("the cluster has given up the task"))
    except BaseException as error:
        promised.set_exception(error)
    else:
        promised.set_result(result)
