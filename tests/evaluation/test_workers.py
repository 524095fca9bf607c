"""A campaign on a local Dask cluster of two workers."""

import logging
from pathlib import Path

import pytest

from falsifier.campaigns import run_campaign
from falsifier.errors import ModelError, SpecError
from falsifier.evaluation.workers import local_executor, open_workers
from tests.campaigns.support import outcomes, request, work_in_threads


def test_a_cluster_gives_the_same_results_as_this_machine(tmp_path: Path) -> None:
    from distributed import LocalCluster

    wanted = request("easy", "hard", engines=("uniform", "corners"), seeds=1)
    with pytest.MonkeyPatch.context() as patch:
        work_in_threads(patch)
        run_campaign(wanted, tmp_path / "here")
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
        run_campaign(wanted, tmp_path / "cluster", executor=f"dask:{cluster.scheduler_address}")
    assert outcomes(tmp_path / "cluster") == outcomes(tmp_path / "here")


def test_other_executors_are_refused() -> None:
    with pytest.raises(SpecError, match="expected dask:tcp://HOST:PORT"), open_workers(1, "ray:auto"):
        pass


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.evaluation.workers._CONNECT_TIMEOUT", 0.5)
    with (
        pytest.raises(ModelError, match="cannot reach a Dask scheduler"),
        open_workers(1, "dask:tcp://127.0.0.1:9"),
    ):
        pass


def level() -> int:
    """Level of the logger that says it, in the process that is asked."""
    return logging.getLogger("falsifier.fmu").level


def test_processes_that_simulate_are_as_quiet_as_their_parent() -> None:
    logger = logging.getLogger("falsifier.fmu")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with local_executor(2) as executor:
            assert executor is not None
            assert executor.submit(level).result() == logging.ERROR
    finally:
        logger.setLevel(before)
