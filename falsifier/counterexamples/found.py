"""Counterexamples of finished runs as files, so that ``falsifier replay RUN`` and its kin take them up."""

from pathlib import Path

from falsifier.counterexamples.store import FILE_NAME, StoredCounterexample, save
from falsifier.search.journal import read_manifest
from falsifier.search.manifest import Manifest
from falsifier.search.tally import read_candidate, read_tally


def keep_counterexample(directory: Path) -> None:
    """Write a run directory's counterexample file from its journal, where one was found and it is missing.

    Written here and not by the worker, whose folder may be on another machine.
    """
    file = directory / FILE_NAME
    if file.exists() or not (directory / "manifest.json").exists():
        return
    tally = read_tally(directory)
    if tally.counterexample is None or tally.verdict is None:
        return
    manifest = Manifest.model_validate(read_manifest(directory))
    stored = StoredCounterexample(
        requirement=manifest.requirement["name"],
        formula=manifest.requirement["formula"],
        problem=manifest.request.problem,
        candidate=read_candidate(directory, tally.counterexample),
        robustness=tally.verdict["robustness"],
        critical_time=tally.verdict["critical_time"],
        predicate=tally.verdict["predicate"],
        outcome="confirmed",
        reason=tally.reason,
        fmu_sha256=next((digest for path, digest in manifest.hashes.items() if path.endswith(".fmu")), None),
    )
    save(stored, file)
