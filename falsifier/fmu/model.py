"""FMUs as models, which implement the Model protocol, and the files behind any model."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import path_of
from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface, Model, ModelInfo
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ModelError
from falsifier.fmu.description.archive import WINDOWS, file_hash
from falsifier.fmu.description.model_description import Description, describe, needed_tool_text
from falsifier.fmu.process.network import Coupling, Member, Network, Place
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.plan import held_pieces
from falsifier.fmu.process.registry import Isolated, load, simulate
from falsifier.fmu.systems.system import System


@dataclass(frozen=True, slots=True)
class FmuModel(Isolated):
    """An FMU and how to simulate it; the library is loaded at the first simulation.

    Attributes:
        path: path of the .fmu file.
        interface: ``co-simulation`` (the FMU contains its own solver) or ``model-exchange``.
        logging: whether to ask the FMU for messages in every simulation; otherwise only after a failure.
        windows: whether to simulate the library for 64-bit Windows, through Wine, although there is another;
            if there is no other for this machine, that happens anyway.
        allow: what the FMU may do beyond changing its own folders: ``write:PATH``, ``read:PATH`` (a file or
            folder that may hold keys), ``programs`` (execute programs).
        deny: what it may not do: ``network`` (open connections).
        sha256: hash of the file; models with different files are not equal.

    Raises:
        ModelError: if the file is not an FMU or does not offer the interface.
        SpecError: if what is allowed or denied is unknown, or a path does not exist.
    """

    path: Path
    interface: Interface = "co-simulation"
    windows: bool = field(default=False, kw_only=True)
    sha256: str = field(default="", init=False)

    def __post_init__(self) -> None:
        self._resolve_rights()
        object.__setattr__(self, "path", path_of("path", self.path).absolute())
        object.__setattr__(self, "sha256", file_hash(self.path))
        _check_interface(self)

    @property
    def info(self) -> ModelInfo:
        """The FMU's description of itself."""
        return self._description.info

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Simulate once, as described in ``falsifier.core.model.Model.simulate``.

        In co-simulation an input is set at each communication point to the signal's value at that time; in
        model exchange the solver evaluates it at any time. Inputs of other types than real are rounded.
        """
        try:
            return simulate(self.order, experiment, self._pieces(signals, experiment), parameters)
        except ModelError as error:
            raise self._with_hint(error) from None

    def place(self, name: str) -> tuple[str, int]:
        """Return where a scalar stands: the name that the FMU declares, and the position in that array."""
        slot = self._description.slot(name)
        return slot.declared or name, slot.offset

    def elements(self, declared: str) -> tuple[str, ...]:
        """Return the names of the elements of an array in order; of a scalar, its own."""
        slots = self._description.slots
        # Reversed, so that the first names win: aliases come after the variable that they stand for.
        names = {s.offset: n for n, s in reversed(list(slots.items())) if (s.declared or n) == declared}
        return tuple(names[offset] for offset in sorted(names))

    def load(self) -> None:
        """Load the library and make an instance in a worker, without simulating; ModelError if that fails."""
        load(replace(self.order, logging=True))

    def _make_order(self) -> Order:
        """Make what workers are asked to simulate."""
        description = self._description
        through_wine = self.windows or description.needs_wine(self.interface)
        member = Member("", self.path, self.sha256, description, None, self.interface)
        places = {name: Place(0, name) for name in description.slots}
        return Order(
            network=Network(str(self.path), (member,), (), (0,), (), Coupling(), description, places),
            key=(self.sha256, self.interface, self.logging, through_wine, self.rights),
            logging=self.logging,
            rights=self.rights,
            through_wine=through_wine,
        )

    def _pieces(
        self, signals: Mapping[str, Signal], experiment: Experiment
    ) -> dict[str, NDArray[np.float64]]:
        """Return the inputs as piecewise cubics; for a solver, discrete ones change on the output grid."""
        tables = {name: signal.pieces(experiment.stop_time) for name, signal in signals.items()}
        if self.interface == "model-exchange":
            for variable in self.info.inputs:
                if variable.name in signals and not variable.is_continuous:
                    signal, whole = signals[variable.name], variable.kind != "real"
                    tables[variable.name] = held_pieces(signal, experiment.times, whole=whole)
        return tables

    def _with_hint(self, error: ModelError) -> ModelError:
        """Return the error; if the FMU runs only where its exporting tool is installed, it says so."""
        if self.interface not in self._description.needs_tool:
            return error
        return ModelError(f"{error}; {needed_tool_text(self.info.tool, (self.interface,))}")

    @property
    def _description(self) -> Description:
        return describe(self.path, self.sha256)


def _check_interface(model: FmuModel) -> None:
    info = model.info
    if model.interface in info.interfaces:
        if model.windows and model.interface not in model._description.libraries.windows:
            raise ModelError(
                f"{model.path}: the FMU has no library for {WINDOWS}, only "
                f"{', '.join(info.platforms) or 'no binaries at all'}"
            )
        return
    if model.interface not in get_args(Interface):
        raise ModelError(f"unknown interface {model.interface!r}; expected one of {get_args(Interface)}")
    if not info.interfaces:
        raise ModelError(
            f"{model.path}: the FMU offers neither co-simulation nor model exchange, and scheduled "
            "execution is not supported; export it for co-simulation"
        )
    raise ModelError(
        f'{model.path}: the FMU does not offer {model.interface}; set interface = "{info.interfaces[0]}"'
    )


def fmu_files(model: Model) -> dict[Path, str]:
    """Return the paths of a model's FMUs with the SHA-256 of each; empty for a Python function."""
    if isinstance(model, FmuModel):
        return {model.path: model.sha256}
    return {part.fmu: part.sha256 for part in model.parts.values()} if isinstance(model, System) else {}


def is_packaged(model: Model) -> bool:
    """Whether a model comes from an SSP package, whose file stands for those of its FMUs."""
    return isinstance(model, System) and model.package is not None


def is_solved(model: Model) -> bool:
    """Whether a solver of ours integrates a model: an FMU in model exchange."""
    return isinstance(model, FmuModel) and model.interface == "model-exchange"


def fmus_sha256(digests: Iterable[str]) -> str | None:
    """Return one hash for the FMUs with these hashes: that of a single FMU is its own; None without FMUs."""
    distinct = sorted(set(digests))
    if len(distinct) < 2:
        return distinct[0] if distinct else None
    return sha256("".join(distinct).encode()).hexdigest()
