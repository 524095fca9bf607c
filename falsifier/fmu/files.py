"""The FMU files behind a model, whether it is one FMU, a system, or neither."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

from falsifier.core.model import Model
from falsifier.fmu.model import FmuModel
from falsifier.fmu.systems import System


def fmu_files(model: Model) -> dict[Path, str]:
    """Return the paths of a model's FMUs with the SHA-256 of each; empty for a Python function."""
    if isinstance(model, FmuModel):
        return {model.path: model.sha256}
    if isinstance(model, System):
        return {part.fmu: part.sha256 for part in model.parts.values()}
    return {}


def is_packaged(model: Model) -> bool:
    """Whether a model comes from an SSP package, whose file stands for those of its FMUs."""
    return isinstance(model, System) and model.package is not None


def fmus_sha256(digests: Iterable[str]) -> str | None:
    """Return one hash for the FMUs with these hashes: that of a single FMU is its own; None without FMUs."""
    distinct = sorted(set(digests))
    if len(distinct) < 2:
        return distinct[0] if distinct else None
    return sha256("".join(distinct).encode()).hexdigest()


def with_local_files(model: Model, paths: Mapping[str, Path]) -> Model:
    """Return a model whose FMUs are read from other paths.

    Args:
        model: one FMU, a system, or neither.
        paths: path of each FMU by the SHA-256 of its content; the others stay where they are.
    """
    if isinstance(model, FmuModel):
        return replace(model, path=paths.get(model.sha256, model.path))
    if isinstance(model, System):
        parts = {n: replace(p, fmu=paths.get(p.sha256, p.fmu)) for n, p in model.parts.items()}
        return replace(model, components=parts)
    return model
