"""Systems of FMUs as models: components, connections between them, and how they exchange values."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import instance
from falsifier.core.experiment import Experiment
from falsifier.core.model import ModelInfo
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.fmu.process.network import SYSTEM, Coupling, Network
from falsifier.fmu.process.order import Order, own_steps
from falsifier.fmu.process.plan import held_pieces
from falsifier.fmu.process.registry import Isolated, simulate
from falsifier.fmu.systems.components import Component, Connection, Frame
from falsifier.fmu.systems.wiring import make_network


@dataclass(frozen=True, slots=True)
class System(Isolated):
    """Several connected FMUs, simulated together; their variables are ``component.variable``.

    Attributes:
        components: the FMUs by name: a path, or a Component if its step or its interface is stated.
        connections: by input, where its values come from: the name of an output, or a Connection.
        coupling: how the components exchange values.
        frame: inputs, names, values and stop time that the system has as a whole.
        name: name of the system.
        package: the SSP package that it was read from, if it was.
        logging: whether to ask the FMUs for messages in every simulation; otherwise only after a failure.
        allow: what the FMUs may do; see FmuModel.
        deny: what they may not do.
        key: hash of everything that determines the trajectories, such as FMUs and connections, and the name.

    Raises:
        ModelError: if a file is not an FMU.
        SpecError: naming both ends of a connection that does not fit, and the remedy.

    >>> System(
    ...     {"plant": "plant.fmu", "controller": "controller.fmu"},
    ...     {"plant.u": "controller.y", "controller.measured": "plant.y"},
    ... )  # doctest: +SKIP
    """

    components: Mapping[str, Component | str | Path]
    connections: Mapping[str, Connection | str] = field(default_factory=dict)
    coupling: Coupling = field(default=Coupling(), kw_only=True)
    frame: Frame = field(default=Frame(), kw_only=True)
    name: str = field(default="system", kw_only=True)
    package: Path | None = field(default=None, kw_only=True, compare=False)
    key: str = field(default="", init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._resolve_rights()
        instance("components", self.components, Mapping, "FMUs by name")
        instance("connections", self.connections, Mapping, "outputs by input")
        instance("coupling", self.coupling, Coupling, "a Coupling such as Coupling('jacobi')")
        instance("name", self.name, str, "a text")
        for name, given in self.components.items():
            instance("components", name, str, "names of FMUs that are texts")
            instance(
                f"components: {name}", given, (Component, str, Path), "a Component or the path of an FMU"
            )
        for target, source in self.connections.items():
            instance(f"connections: {target}", source, (Connection, str), "an output or a Connection")
        if not self.components:
            raise SpecError("components: expected at least one FMU")
        if "" in self.components:
            raise SpecError("components: the name of a component is empty; give it one")
        components = {
            name: each if isinstance(each, Component) else Component(each)
            for name, each in self.components.items()
        }
        connections = {
            target: each if isinstance(each, Connection) else Connection(each)
            for target, each in self.connections.items()
        }
        object.__setattr__(self, "components", components)
        object.__setattr__(self, "connections", connections)
        object.__setattr__(self, "key", _key(self))
        _ = self.network  # checks it

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def parts(self) -> dict[str, Component]:
        """The components by name."""
        return {name: each for name, each in self.components.items() if isinstance(each, Component)}

    @property
    def info(self) -> ModelInfo:
        """The variables of all components, and what is known about the system."""
        return self.network.description.info

    @property
    def network(self) -> Network:
        """The checked system: members, links and the order of stepping."""
        return self.order.network

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Simulate once, as described in ``falsifier.core.model.Model.simulate``.

        An input that is not connected is set at each communication point to the signal's value at that time.

        Raises:
            SimulationError: if there is no complete trajectory; names the component that failed.
            SpecError: if a component's own step is no multiple of the communication step, or too long.
        """
        values = dict(self.frame.values)
        texts = tuple((n, v) for n, v in values.items() if isinstance(v, str))
        experiment = replace(experiment, strings=(*texts, *experiment.strings)) if texts else experiment
        numbers = {n: v for n, v in values.items() if not isinstance(v, str) and n not in signals}
        numbers |= parameters
        # An input of the whole that no signal drives is constant.
        driven = dict(signals)
        for variable in self.frame.inputs:
            if variable.name not in signals:
                start = numbers.pop(variable.name, variable.start_number or 0.0)
                driven[variable.name] = Signal((0.0,), (start,), "constant")
        tables = {name: self._pieces(name, signal, experiment) for name, signal in driven.items()}
        return simulate(self.order, experiment, tables, numbers)

    def _pieces(self, name: str, signal: Signal, experiment: Experiment) -> NDArray[np.float64]:
        """Return an input as piecewise cubics; for a solver, a discrete one changes in steps."""
        pieces, variable, members = signal.pieces(experiment.stop_time), self.info[name], self.network.members
        owner = self.network.places[name].member
        fed = members if owner == SYSTEM else (members[owner],)
        is_solved = any(member.interface == "model-exchange" for member in fed)
        if variable.is_continuous or not is_solved or not pieces[:, 2:].any():
            return pieces
        points = np.linspace(0.0, experiment.stop_time, round(experiment.stop_time / experiment.step) + 1)
        return held_pieces(signal, points, whole=variable.kind != "real")

    def check_steps(self, experiment: Experiment) -> None:
        """Check that own steps are multiples of the step; SpecError naming component and what fits."""
        stated_as = "step_size" if experiment.step_size else "output_interval"
        for member in self.network.members:
            own_steps(member, experiment.step, experiment.stop_time, stated_as=stated_as)

    def _make_order(self) -> Order:
        """Make what workers are asked to simulate."""
        connected = {name: each for name, each in self.connections.items() if isinstance(each, Connection)}
        network = make_network(self.name, self.parts, connected, self.coupling, self.frame)
        key = (self.key, self.logging, self.rights)
        return Order(network=network, key=key, logging=self.logging, rights=self.rights)


def _key(system: System) -> str:
    components = [(name, each.sha256, each.step, each.interface) for name, each in system.parts.items()]
    connections = sorted(system.connections.items(), key=str)
    content = (system.name, components, connections, system.coupling, system.frame)
    return sha256(repr(content).encode()).hexdigest()
