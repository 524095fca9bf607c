"""The master of a system in plain Python on FMPy's classes, an independent reference for that of the worker.

It does what worker/system.c does, in the same order, for components of co-simulation.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import Experiment
from falsifier.core.signals import Signal as InputSignal
from falsifier.fmu import System
from falsifier.fmu.systems.network import SYSTEM, Member, Place

# Early returns at one time, or rounds of one event iteration, after which an FMU is considered stuck.
MAX_ROUNDS = 1000


class Signal:
    """The last two values of a connected output; a negative time means that there is none yet."""

    def __init__(self) -> None:
        self.value = self.old_value = self.tried = 0.0
        self.time = self.old_time = -1.0

    def update(self, value: float, time: float) -> None:
        """Take the value at a time in s, perhaps again."""
        if time != self.time:
            self.old_value, self.old_time = self.value, self.time
        self.tried = self.value
        self.value, self.time = value, time

    def at(self, time: float, *, is_linear: bool) -> float:
        """Return the value that an input gets from it: the last one, or that of the line through two."""
        if not is_linear or not 0.0 <= self.old_time < self.time:
            return self.value
        slope = (self.value - self.old_value) / (self.time - self.old_time)
        return self.value + slope * (time - self.time)


class Component:
    """One FMU of the system, loaded and instantiated."""

    def __init__(self, name: str, about: dict[str, Any], folder: Path) -> None:
        import fmpy
        from fmpy import fmi2, fmi3

        self.name, self.about, self.every = name, about, about["every"]
        self.has_events = about["event_mode"]
        self.arrays = {reference: list(values) for reference, values in about["arrays"].items()}
        self.waiting: dict[str, float] = {}
        self.held: dict[str, float] = {}
        # Each component has a copy of its own: two with the same FMU then share no static data.
        fmpy.extract(str(about["fmu"]), str(folder))
        make = fmi3.FMU3Slave if about["fmi"] == 3 else fmi2.FMU2Slave
        self.fmu = make(
            guid=about["token"],
            modelIdentifier=about["identifier"],
            unzipDirectory=str(folder),
            instanceName=name,
            requireFunctions=False,
        )
        back = Path.cwd()
        if about["fmi"] == 3:
            self.fmu.instantiate(eventModeUsed=self.has_events, earlyReturnAllowed=self.has_events)
        else:
            self.fmu.instantiate()
        os.chdir(back)  # some FMUs leave it

    def set(self, name: str, value: Any) -> None:
        """Set a variable; integers are rounded, and of an array all elements are set."""
        kind, reference, element, size = self.about["variables"][name]
        values = self.arrays[reference] if size > 1 else [value]
        values[element] = value
        getattr(self.fmu, f"set{kind}")([reference], [typed(kind, each) for each in values])

    def get(self, name: str) -> float:
        """Return the value of a variable as a number; true is 1."""
        kind, reference, element, size = self.about["variables"][name]
        values = getattr(self.fmu, f"get{kind}")([reference], *([size] if size > 1 else []))
        return float(bool(values[element]) if kind == "Boolean" else values[element])

    def enter(self, tolerance: float | None, stop_time: float) -> None:
        """Set parameters and start values and enter initialisation mode."""
        for name, value in self.about["start"].items():
            self.set(name, value)
        if self.about["fmi"] == 3:
            self.fmu.enterInitializationMode(tolerance, 0.0, stop_time)
        else:
            self.fmu.setupExperiment(tolerance, 0.0, stop_time)
            self.fmu.enterInitializationMode()

    def leave(self) -> None:
        """Leave initialisation mode, and the event mode that follows it in FMI 3."""
        self.fmu.exitInitializationMode()
        if self.has_events:
            self.settle()
            self.fmu.enterStepMode()

    def settle(self) -> None:
        """In event mode, update the discrete states until they no longer change."""
        for _ in range(MAX_ROUNDS):
            again, ends, *_ = self.fmu.updateDiscreteStates()
            if ends:
                raise AssertionError(f"{self.name}: the FMU terminated the simulation")
            if not again:
                return
        raise AssertionError(f"{self.name}: the events never end")

    def gather(self, signals: dict[str, Signal], driven: dict[str, float], middle: float) -> None:
        """Collect the inputs of a step: from outside as at its start, connected ones as in its middle."""
        for name, feed in self.about["inputs"].items():
            if "from" not in feed:
                source = driven[feed["input"]] if "input" in feed else feed["value"]
            elif signals[feed["from"]].time >= 0.0:
                source = signals[feed["from"]].at(middle, is_linear=feed["linear"])
            else:
                self.waiting[name] = feed["value"]
                continue
            self.waiting[name] = feed["factor"] * source + feed["offset"]

    def set_first_inputs(self) -> None:
        """Set all inputs in initialisation mode."""
        for name, value in self.waiting.items():
            self.set(name, value)
        self.held = {name: self.waiting[name] for name in self.about["held"]}

    def step(self, start: float, end: float) -> bool:
        """Set the inputs and do one step; return whether the FMU ends the simulation."""
        held = {name: self.waiting[name] for name in self.about["held"]}
        for name, value in self.waiting.items():
            if name not in held:
                self.set(name, value)
        if held != self.held:  # these may change in event mode only
            self.held = held
            self.fmu.enterEventMode()
            for name, value in held.items():
                self.set(name, value)
            self.settle()
            self.fmu.enterStepMode()
        if self.about["fmi"] == 3:
            return self.advance(start, end)
        self.fmu.doStep(start, end - start)
        return False

    def advance(self, start: float, end: float) -> bool:
        """Do a step of FMI 3, in several calls if the FMU returns early; return whether it ends all."""
        time = start
        for _ in range(MAX_ROUNDS):
            event, ends, is_early, reached = self.fmu.doStep(time, end - time)
            time = reached if is_early else end
            if event and self.has_events and not ends:
                self.fmu.enterEventMode()
                self.settle()
                self.fmu.enterStepMode()
            if ends or end - time <= 1e-12 * max(1.0, abs(end)):
                return bool(ends)
        raise AssertionError(f"{self.name}: the FMU makes no progress at t = {time:g} s")

    def read(self, signals: dict[str, Signal], time: float) -> None:
        """Read the connected outputs."""
        for name in self.about["outputs"]:
            signals[f"{self.name}.{name}"].update(self.get(name), time)

    def keep(self) -> tuple[Any, dict[str, float]]:
        """Return the state before a step that may be repeated."""
        get = self.fmu.getFMUState if self.about["fmi"] == 3 else self.fmu.getFMUstate
        return get(), dict(self.held)

    def bring_back(self, kept: tuple[Any, dict[str, float]]) -> None:
        """Return to a state that was kept."""
        (self.fmu.setFMUState if self.about["fmi"] == 3 else self.fmu.setFMUstate)(kept[0])
        self.held = dict(kept[1])

    def free(self, kept: tuple[Any, dict[str, float]]) -> None:
        """Free a state that was kept."""
        (self.fmu.freeFMUState if self.about["fmi"] == 3 else self.fmu.freeFMUstate)(kept[0])


def typed(kind: str, value: Any) -> Any:
    """Return a number as FMI takes a value of this type."""
    if kind in ("String", "Real", "Float64", "Float32"):
        return value
    return value >= 0.5 if kind == "Boolean" else round(value)


class Master:
    """Initialises the components across their connections and steps them together."""

    def __init__(
        self,
        system: dict[str, Any],
        components: list[Component],
        driven: Callable[[int], dict[str, float]],
    ) -> None:
        self.system, self.components, self.driven = system, components, driven
        self.step = system["stop_time"] / system["steps"]
        self.signals = {f"{c.name}.{n}": Signal() for c in components for n in c.about["outputs"]}

    def simulate(self) -> list[list[float]]:
        """Simulate; return the rows to record, each with its time first."""
        for component in self.components:
            component.enter(self.system["tolerance"], self.system["stop_time"])
        self.find_first_values()
        for component in self.components:
            component.leave()
        for component in self.components:
            component.read(self.signals, 0.0)
        rows = [self.row(0.0)]
        for k in range(self.system["steps"]):
            is_last = k + 1 == self.system["steps"]
            end = self.system["stop_time"] if is_last else min((k + 1) * self.step, self.system["stop_time"])
            ends = self.jacobi(k, end) if self.system["method"] == "jacobi" else self.gauss_seidel(k, end)
            if (k + 1) % self.system["every"] == 0:
                rows.append(self.row(end))
            if ends and not is_last:
                raise AssertionError(f"an FMU terminated the simulation at t = {end:g} s")
        return rows

    def find_first_values(self) -> None:
        """Repeat rounds through all components until the connected outputs at time 0 no longer change."""
        before = [float("inf")] * len(self.signals)
        for _ in range(self.system["max_rounds"]):
            for component in self.components:
                component.gather(self.signals, self.driven(0), 0.0)
                component.set_first_inputs()
                component.read(self.signals, 0.0)
            values = [signal.value for signal in self.signals.values()]
            if not any(map(self.moves, values, before)):
                return
            before = values
        raise AssertionError("the initialisation does not converge")

    def moves(self, value: float, before: float) -> bool:
        """Whether a value has not yet converged."""
        return not abs(value - before) <= self.system["convergence"] * max(1.0, abs(value))

    def jacobi(self, k: int, end: float) -> bool:
        """Let all components step from the values at the start of their steps."""
        for component in self.components:
            if k % component.every == 0:
                middle = k * self.step + 0.5 * component.every * self.step
                component.gather(self.signals, self.driven(k), middle)
        due = [c for c in self.components if (k + 1) % c.every == 0]
        ends = [c.step((k + 1 - c.every) * self.step, end) for c in due]
        for component in due:
            component.read(self.signals, end)
        return any(ends)

    def gauss_seidel(self, k: int, end: float) -> bool:
        """Let one component step after the other; those of a loop repeat their steps."""
        ends, position = [False], 0
        while position < len(self.components):
            last = self.system["loops"].get(position)
            if last:
                ends.append(self.iterate(self.components[position:last], k, end))
            elif (k + 1) % self.components[position].every == 0:
                ends.append(self.one_step(self.components[position], k, end))
            position = last or position + 1
        return any(ends)

    def one_step(self, component: Component, k: int, end: float) -> bool:
        """Let a component step with the newest values, at the end of a step of its own."""
        first = k + 1 - component.every
        start = first * self.step
        component.gather(self.signals, self.driven(first), 0.5 * (start + end))
        ends = component.step(start, end)
        component.read(self.signals, end)
        return ends

    def iterate(self, components: list[Component], k: int, end: float) -> bool:
        """Repeat the steps of a loop until its outputs agree."""
        due = [c for c in components if (k + 1) % c.every == 0]
        kept = [component.keep() for component in due]
        try:
            for turn in range(self.system["max_rounds"]):
                ends, moves = [], False
                for component, state in zip(due, kept, strict=True):
                    if turn:
                        component.bring_back(state)
                    ends.append(self.one_step(component, k, end))
                    outputs = [self.signals[f"{component.name}.{n}"] for n in component.about["outputs"]]
                    moves = moves or any(self.moves(s.value, s.tried) for s in outputs)
                if turn and not moves:
                    return any(ends)
        finally:
            for component, state in zip(due, kept, strict=True):
                component.free(state)
        raise AssertionError(f"the loop of {', '.join(c.name for c in components)} does not converge")

    def row(self, time: float) -> list[float]:
        """Return time and recorded values: connected outputs as they were exchanged, others as they are."""
        by_name = {component.name: component for component in self.components}
        values = [
            self.signals[f"{name}.{variable}"].value
            if f"{name}.{variable}" in self.signals
            else by_name[name].get(variable)
            for name, variable in self.system["recorded"]
        ]
        return [time, *values]


def simulate(
    model: System,
    experiment: Experiment,
    signals: Mapping[str, InputSignal],
    parameters: Mapping[str, float],
    root: Path,
) -> NDArray[np.float64]:
    """Simulate a system with FMPy; return time and recorded outputs by sample, shape (samples, 1 + outputs).

    FMUs are unpacked to subfolders of ``root``.
    """
    system = tables(model, experiment, signals, parameters)
    parts = [
        Component(name, about, root / str(k)) for k, (name, about) in enumerate(system["components"].items())
    ]
    times = np.arange(system["steps"] + 1) * (experiment.stop_time / system["steps"])
    columns = {name: signal.sample(times) for name, signal in signals.items()}
    driven = [{name: float(column[k]) for name, column in columns.items()} for k in range(len(times))]
    rows = Master(system, parts, driven.__getitem__).simulate()
    for part in parts:
        part.fmu.terminate()
        part.fmu.freeInstance()
    return np.array(rows)


def tables(
    model: System, experiment: Experiment, signals: Mapping[str, InputSignal], parameters: Mapping[str, float]
) -> dict[str, Any]:
    """Return the system as plain tables.

    They have the times, how values are exchanged, and the recorded variables. Each component, in the order
    of stepping, has its FMU, the number of communication steps per step of its own, variables (type, value
    reference, element and size of an array), start values, connected outputs, and the source of each input:
    ``factor * source + offset``. The source is a connected output (before it is known, the input is
    ``value``), a signal, or the constant ``value``. ``held`` inputs change in event mode only. ``loops``:
    positions from where to where components repeat their steps.
    """
    network, coupling = model.network, model.network.coupling
    values = {**dict(model.frame.values), **parameters, **dict(experiment.strings)}
    feeds = _feeds(model, signals, values)
    every = max(round(experiment.output_interval / (experiment.step_size or experiment.output_interval)), 1)
    steps = (experiment.samples - 1) * every
    places = [network.places[name] for name in experiment.outputs]
    start = {network.places[name]: value for name, value in values.items()}
    sources = {link.source for link in network.links}
    components = {}
    for k in network.order:
        member = network.members[k]
        components[member.name] = _component(
            member,
            experiment.stop_time / steps,
            start={p.name: value for p, value in start.items() if p.member == k and p not in feeds},
            feeds={p.name: feed for p, feed in feeds.items() if p.member == k},
            outputs=sorted(p.name for p in sources if p.member == k),
            others=sorted({p.name for p in places if p.member == k}),
        )
    return {
        "stop_time": experiment.stop_time,
        "steps": steps,
        "every": every,
        "tolerance": experiment.tolerance,
        "method": coupling.method,
        "convergence": coupling.tolerance,
        "max_rounds": coupling.max_rounds,
        "loops": dict(network.loops),
        "components": components,
        "recorded": [(network.members[p.member].name, p.name) for p in places],
    }


def _component(
    member: Member,
    step: float,
    *,
    start: Mapping[str, float | str],
    feeds: Mapping[str, Mapping[str, Any]],
    outputs: list[str],
    others: list[str],
) -> dict[str, Any]:
    description = member.description
    slots = {name: description.slots[name] for name in dict.fromkeys((*start, *feeds, *outputs, *others))}
    kinds = {v.name: v for v in description.info.variables}
    has_events = description.major == 3 and description.event_mode
    arrays = {slot.reference for slot in slots.values() if slot.size > 1}
    return {
        "fmu": member.path,
        "fmi": description.major,
        "token": description.token,
        "identifier": description.identifiers[member.interface],
        "event_mode": has_events,
        "every": 1 if member.step is None else round(member.step / step),
        "variables": {name: (s.type, s.reference, s.offset, s.size) for name, s in slots.items()},
        "arrays": {reference: description.arrays[reference] for reference in arrays},
        "start": dict(start),
        "inputs": dict(feeds),
        "held": [name for name in feeds if has_events and kinds[name].variability != "continuous"],
        "outputs": outputs,
    }


def _feeds(
    model: System, signals: Mapping[str, InputSignal], values: Mapping[str, float | str]
) -> dict[Place, dict[str, Any]]:
    """Return where each input comes from: a connected output, a signal, or a constant."""
    network = model.network
    feeds: dict[Place, dict[str, Any]] = {}
    for link in network.links:
        feed: dict[str, Any] = {"factor": link.factor, "offset": link.offset}
        if link.source.member != SYSTEM:
            feed |= {"from": network.title(link.source), "value": link.start, "linear": link.is_linear}
        elif link.source.name in signals:
            feed |= {"input": link.source.name}
        else:
            constant = values.get(link.source.name, model.info[link.source.name].start)
            feed |= {"value": float(constant or 0.0)}
        feeds[link.target] = feed
    for name in signals:
        if network.places[name].member != SYSTEM:
            feeds[network.places[name]] = {"factor": 1.0, "offset": 0.0, "input": name}
    return feeds
