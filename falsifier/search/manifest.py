"""What a run directory says of how it came to be."""

import platform
import sys
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from falsifier import __version__
from falsifier.core.space import InputRange, ParameterRange
from falsifier.errors import JournalError
from falsifier.problem.problem import Problem, conjunction
from falsifier.search.journal import read_manifest
from falsifier.search.request import RunRequest
from falsifier.stl import Formula, parse

_RECORDED_PACKAGES = ("fmpy", "litellm", "numba", "numpy", "rtamt", "scipy")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class InputRecord(_Strict):
    """One searched input or parameter, so that a run can be drawn without its model."""

    name: str
    low: float
    high: float
    unit: str = ""
    description: str = ""


class Manifest(_Strict):
    """What a run directory says of how it came to be."""

    falsifier: str = Field(description="Version of this package.")
    python: str
    platform: str
    packages: dict[str, str] = Field(description="Versions of the packages that decide numbers.")
    started: str = Field(description="Date and time in UTC.")
    request: RunRequest
    source: str = Field(description="Where the problem was loaded from.")
    requirement: dict[str, str] = Field(description="name, formula and description of the requirement.")
    requirements: tuple[dict[str, str], ...] = Field(
        (), description="The same of each, where several are falsified together."
    )
    model: str = Field(description="Name of the model.")
    inputs: tuple[InputRecord, ...]
    parameters: tuple[InputRecord, ...]
    stop_time: float = Field(description="End of each simulation in s.")
    hashes: dict[str, str] = Field(description="SHA-256 by path of the FMU and the spec.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the requirements; several where they are falsified together."""
        return self.request.together if self.shared else (self.requirement["name"],)

    @property
    def shared(self) -> bool:
        """Whether several requirements are falsified together."""
        return len(self.request.together) > 1

    def of(self, name: str) -> "Manifest":
        """Return the same with one of the requirements alone.

        Raises:
            JournalError: for another name; it says which ones there are.
        """
        if name not in self.names:
            raise JournalError(f"this run searched {', '.join(self.names)}, not {name}")
        if not self.shared:
            return self
        found = {each["name"]: each for each in self.requirements} or self._parts()
        return self.model_copy(update={"requirement": found[name]})

    def _parts(self) -> dict[str, dict[str, str]]:
        """Take the requirements apart where only their conjunction was recorded."""
        rest: Formula = parse(self.requirement["formula"])
        parts: list[Formula] = []
        for _ in self.names[1:]:
            rest, last = rest.children
            parts.insert(0, last)
        return {
            name: {"name": name, "formula": str(formula), "description": ""}
            for name, formula in zip(self.names, [rest, *parts], strict=True)
        }


def recorded_request(directory: Path) -> RunRequest:
    """What the run of a directory was asked for."""
    return RunRequest.model_validate(read_manifest(directory)["request"])


def manifest(request: RunRequest, *problems: Problem) -> Manifest:
    """Describe a run before it starts; several problems are falsified together."""
    problem = conjunction(problems)
    space = problem.space
    return Manifest(
        **environment(),
        request=request,
        source=problem.source,
        requirement=_requirement_record(problem),
        requirements=tuple(map(_requirement_record, problems)) if len(problems) > 1 else (),
        model=problem.info.name,
        inputs=tuple(_range_record(r) for r in space.inputs),
        parameters=tuple(_range_record(p) for p in space.parameters),
        stop_time=space.stop_time,
        hashes=file_hashes(problem),
    )


def environment() -> dict[str, Any]:
    """Versions, platform and time, as manifests state them."""
    return {
        "falsifier": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "packages": {name: found for name in _RECORDED_PACKAGES if (found := _version(name))},
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def file_hashes(problem: Problem) -> dict[str, str]:
    """SHA-256 by path of the files that decide what is simulated: the FMU and the spec."""
    spec = problem.source.rpartition(":")[0]
    paths = [getattr(problem.model, "path", None), Path(spec) if spec.endswith(".toml") else None]
    return {str(p): sha256(Path(p).read_bytes()).hexdigest() for p in paths if p is not None}


def check_unchanged(directory: Path, recorded: dict[str, str], found: dict[str, str]) -> None:
    """Refuse to continue with other files than those that a run or campaign was started with.

    Raises:
        JournalError: naming the file that has changed.
    """
    for path, digest in found.items():
        if recorded.get(path, digest) != digest:
            raise JournalError(f"{directory}: {path} has changed since this was started; start anew")


def _requirement_record(problem: Problem) -> dict[str, str]:
    requirement = problem.requirement
    return {
        "name": problem.name,
        "formula": str(requirement.formula),
        "description": requirement.description,
    }


def _range_record(range_: InputRange | ParameterRange) -> InputRecord:
    return InputRecord(
        name=range_.name,
        low=range_.low,
        high=range_.high,
        unit=range_.unit,
        description=range_.description,
    )


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
