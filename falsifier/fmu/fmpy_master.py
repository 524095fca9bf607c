"""The master of a system in plain Python on FMPy's classes, as exported counterexamples carry it.

Nothing here imports this module: its text becomes the second half of a script, after tables of the system's
components and connections. Therefore it needs only fmpy and numpy. It does what master.py and
coupled_stepping.py do, in the same order; tests compare the two. ``main`` describes the tables.
"""

import csv
import os
import tempfile
from pathlib import Path
from typing import Any

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

    def __init__(self, name: str, about: dict[str, Any], here: Path, folder: Path) -> None:
        import fmpy
        from fmpy import fmi2, fmi3

        self.name, self.about, self.every = name, about, about["every"]
        self.has_events = about["event_mode"]
        self.arrays = {reference: list(values) for reference, values in about["arrays"].items()}
        self.waiting: dict[str, float] = {}
        self.held: dict[str, float] = {}
        # Each component has a copy of its own: two with the same FMU then share no static data.
        fmpy.extract(str(here / about["fmu"]), str(folder))
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
                raise SystemExit(f"{self.name}: the FMU terminated the simulation")
            if not again:
                return
        raise SystemExit(f"{self.name}: the events never end")

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
        raise SystemExit(f"{self.name}: the FMU makes no progress at t = {time:g} s")

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

    def __init__(self, system: dict[str, Any], components: list[Component], driven: Any) -> None:
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
                raise SystemExit(f"an FMU terminated the simulation at t = {end:g} s")
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
        raise SystemExit("the initialisation does not converge")

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
        raise SystemExit(f"the loop of {', '.join(c.name for c in components)} does not converge")

    def row(self, time: float) -> list[float]:
        """Return time and recorded values: connected outputs as they were exchanged, others as they are."""
        by_name = {component.name: component for component in self.components}
        values = [
            self.signals[f"{name}.{variable}"].value
            if f"{name}.{variable}" in self.signals
            else by_name[name].get(variable)
            for name, variable in self.system["recorded"].values()
        ]
        return [time, *values]


def read_inputs(file: Path, names: list[str], system: dict[str, Any]) -> Any:
    """Return a function that gives the inputs at a communication point, after the step if they step there."""
    import numpy as np

    if not names:
        return lambda k: {}
    with file.open(newline="", encoding="utf-8") as lines:
        table = np.array(list(csv.reader(lines))[1:], dtype=float)
    times = np.arange(system["steps"] + 1) * (system["stop_time"] / system["steps"])
    # Of rows with the same time, this takes the last.
    columns = [np.interp(times, table[:, 0], column) for column in table[:, 1:].T]
    return lambda k: {name: float(column[k]) for name, column in zip(names, columns, strict=True)}


def simulate(system: dict[str, Any], here: Path) -> list[list[float]]:
    """Simulate the system whose FMUs and input.csv are in a folder; return the recorded rows."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as root:
        parts = [
            Component(name, about, here, Path(root) / str(k))
            for k, (name, about) in enumerate(system["components"].items())
        ]
        driven = read_inputs(here / "input.csv", system["columns"], system)
        rows = Master(system, parts, driven).simulate()
        for part in parts:
            part.fmu.terminate()
            part.fmu.freeInstance()
    return rows


def main(system: dict[str, Any], here: Path) -> None:
    """Simulate what is in a folder, write outputs.csv, compare the values around the critical time.

    ``system`` has the times, how values are exchanged, and the names of the columns of input.csv and of the
    recorded variables. Each component, in the order in which they step, has its FMU, the number of steps of
    the system per step of its own, variables (type, value reference, element and size of an array), start
    values, connected outputs, and where each input comes from: ``factor * source + offset``. The source is a
    connected output (before it is known, the input is ``value``), a column of input.csv, or the constant
    ``value``. ``held`` inputs change in event mode only. ``loops``: positions from where to where components
    repeat their steps. ``expected``: rows as they were recorded, the critical one among them.
    """
    rows = simulate(system, here)
    names = ["time", *system["recorded"]]
    with (here / "outputs.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)
    shown = [names.index(name) for name in ("time", *system["shown"])]
    print("".join(f"{names[k]:>24}" for k in shown))
    worst = 0.0
    for number, expected in system["expected"].items():
        values = [rows[number][k] for k in shown]
        worst = max([worst, *(abs(a - b) for a, b in zip(values[1:], expected, strict=True))])
        mark = "  <- critical time" if number == system["critical"] else ""
        print("".join(f"{value:24.9g}" for value in values) + mark)
    print(f"largest difference from the recorded values in these rows: {worst:.3g}")
    print(f"all {len(rows)} rows are in outputs.csv next to this script")
