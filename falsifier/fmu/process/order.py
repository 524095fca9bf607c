"""What workers are asked to simulate, in bytes, and what their replies say of it in words.

``falsifier/fmu/worker/system_request.c`` is the other side. Components come in the order in which they step.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from falsifier.core.model import GRID_ROUNDING, Interface
from falsifier.errors import FalsifierError, SimulationError, SpecError
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.network import SYSTEM, Member, Network, Place
from falsifier.fmu.process.plan import Plan, solver_tolerance
from falsifier.fmu.process.rights import Rights


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What a new worker needs to know, and how its replies are to be understood.

    Attributes:
        network: what it simulates.
        key: what tells models apart that cannot share a process.
        logging: whether to ask the FMUs for messages.
        rights: what the FMUs may do.
        through_wine: whether to simulate the library for Windows.
    """

    network: Network
    key: Hashable
    logging: bool
    rights: Rights
    through_wine: bool = False

    def load(self, folder: Path, *, logging: bool) -> bytes:
        """Return the request to load what was unpacked to a folder.

        Raises:
            ModelError: if an FMU has no library for this machine.
        """
        parts = [encoding.integers(self.network.coupling.isolation == "each", len(self.network.order))]
        for k in self.network.order:
            parts.append(
                encoding.fmu(
                    self.network.members[k], folder / str(k), logging=logging, through_wine=self.through_wine
                )
            )
        return b"".join(parts)

    def prepare(self, plan: Plan) -> bytes:
        """Return the request to prepare for a plan's simulations.

        Raises:
            SpecError: if a component's own step does not fit; see ``own_steps``.
        """
        return _prepare(self.network, plan)

    def component(self, position: int) -> str:
        """Return the name of the component at a position that a worker tells; empty for a single FMU."""
        return self.network.stepped(position)

    def failure(self, plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]) -> FalsifierError:
        """Return the error for the reply to a simulation that failed.

        Args:
            plan: of the simulation.
            reply: how it ended.
            refusals: what the FMUs tried and were refused, for the end of the message.
            log: what the FMUs have said.
        """
        if said := self._said(plan, reply):
            text = f"{said}{refusals}{outcome.last_lines(log)}"
            return SimulationError(text, time=max(reply.time, 0.0), log=log)
        name = self.component(reply.component)
        if name and reply.where != Where.TIMEOUT:
            strings = _strings_of(self.network, plan, self.network.order[reply.component])
            plan = replace(plan, model=name, strings=strings)
        return outcome.failure(plan, reply, refusals, log)

    def _said(self, plan: Plan, reply: Reply) -> str:
        """Say what only happens to several components; empty for all else."""
        name, rounds = self.component(reply.component), self.network.coupling.max_rounds
        reached = f"t = {reply.time:g} s"
        before = f"{reached}, before the stop time {plan.stop_time:g} s"
        if reply.where == Where.UNSETTLED:
            return (
                f"{plan.model}: the initialisation does not converge: after {rounds} rounds through the "
                f"connections, these still change: {self._changes(reply)}; they depend on each other in a "
                "loop: give a component other start values or a delay, or raise coupling.max_rounds or "
                "coupling.tolerance"
            )
        if reply.where == Where.NOT_CONVERGED:
            return (
                f"{plan.model}: the loop of {', '.join(self._loop(reply.component))} does not converge at "
                f"{reached}: after {rounds} rounds, these still change: {self._changes(reply)}; raise "
                "coupling.max_rounds or coupling.tolerance, or accept a delay of one communication step: "
                'loops = "delay"'
            )
        if reply.where == Where.RESTORING:
            returned = f"saving or restoring the state returned {outcome.status_name(reply.status)}"
            return f"{name}: {returned} at {before}"
        outputs = ", ".join(self._titles(reply.text.split()))
        if reply.where == Where.NOT_A_NUMBER:
            return f"{name}: {outputs} became nan at {before}"
        whens = {
            Where.MISSING_AT_FIRST: "in the initialisation",
            Where.MISSING_AFTER_START: "after the initialisation",
        }
        when = next((when for where, when in whens.items() if where == reply.where), "")
        return f"{name}: {outputs} is nan at t = 0 s, {when}" if when else ""

    def _loop(self, position: int) -> list[str]:
        """Return the names of the components that iterate with the one at a position of the order."""
        inside = [range(first, last) for first, last in self.network.loops if first <= position < last]
        return sorted(self.network.stepped(k) for k in (inside[0] if inside else ()))

    def _changes(self, reply: Reply) -> str:
        """Name the outputs that still change, and by how much."""
        total, *pairs = reply.text.split() or ["0"]
        titles = self._titles(pairs[::2])
        shown = ", ".join(
            f"{t} (by {_short(change)})" for t, change in zip(titles, pairs[1::2], strict=False)
        )
        more = int(total) - len(titles) if _is_position(total) else 0
        return shown + (f" and {more} more" if more > 0 else "")

    def _titles(self, positions: Sequence[str]) -> list[str]:
        """Return the names of connected outputs at positions that a worker tells, which may tell anything."""
        titles = [self.network.title(place) for place in _connected_outputs(self.network)]
        known = [int(text) for text in positions if _is_position(text)]
        return [titles[k] for k in known if k < len(titles)]


def _is_position(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 10


def _short(number: str) -> str:
    try:
        return f"{float(number):.3g}"
    except ValueError:
        return "an unknown number"


def _strings_of(network: Network, plan: Plan, member: int) -> tuple[tuple[str, str], ...]:
    """Return the string parameters of the component at this position of the network's members."""
    places = [(network.places[name], value) for name, value in plan.strings]
    return tuple((place.name, value) for place, value in places if place.member == member)


def _rows_of(network: Network, names: Sequence[str], member: int) -> list[tuple[Place, int]]:
    """Return the variables of a component among these names, each with its row."""
    places = [network.places[name] for name in names]
    return [(place, row) for row, place in enumerate(places) if place.member == member]


def _sources_of(network: Network, plan: Plan) -> dict[Place, Place]:
    """Return where the values of all inputs with a source come from: an output, or what the plan drives."""
    driven = (network.places[name] for name in plan.inputs)
    links = {link.target: link.source for link in network.links}
    return links | {place: place for place in driven if place.member != SYSTEM}


def _connected_outputs(network: Network) -> dict[Place, int]:
    """Return the outputs that feed inputs, with their positions among the worker's signals."""
    sources = {link.source for link in network.links if link.source.member != SYSTEM}
    ordered = sorted(sources, key=lambda place: (network.order.index(place.member), place.name))
    return {place: k for k, place in enumerate(ordered)}


def _prepare(network: Network, plan: Plan) -> bytes:
    """Return what the worker needs for the simulations of a plan.

    Raises:
        ModelError: if a variable is unknown.
    """
    coupling, signals = network.coupling, _connected_outputs(network)
    steps = any(m.interface == "co-simulation" or m.step is not None for m in network.members)
    # Solvers that exchange nothing stop at the output grid only.
    every = plan.every if steps or network.links else 1
    sizes = (len(plan.parameters), len(plan.inputs), len(plan.outputs))
    outputs = [(network.places[name], row) for row, name in enumerate(plan.outputs)]
    copies = [(signals[place], row) for place, row in outputs if place in signals]
    parts = [
        encoding.integers(plan.samples, every, plan.pieces, *sizes, plan.tolerance is not None),
        encoding.reals(plan.stop_time, plan.max_step, plan.tolerance or 0.0),
        encoding.integers(coupling.method == "jacobi", coupling.max_rounds),
        encoding.reals(coupling.tolerance),
        encoding.integers(len(signals)),
        *(_component(network, plan, position) for position in range(len(network.order))),
        encoding.integers(len(copies), *(number for pair in copies for number in pair)),
    ]
    return b"".join(parts)


def _component(network: Network, plan: Plan, position: int) -> bytes:
    number, signals = network.order[position], _connected_outputs(network)
    member, strings = network.members[number], _strings_of(network, plan, number)
    description = member.description
    given = _rows_of(network, plan.parameters, number)
    recorded = [(p, row) for p, row in _rows_of(network, plan.outputs, number) if p not in signals]
    inputs = [place.name for place in _sources_of(network, plan) if place.member == number]
    held = [name for name in inputs if _is_held(description, member.interface, name)]
    plain = [name for name in inputs if name not in held]
    parameters = [place.name for place, _ in given]
    loop_end = dict(network.loops).get(position, 0)
    is_iterated = any(first <= position < last for first, last in network.loops)
    parts = [
        encoding.reals(solver_tolerance(plan, description.info)),
        encoding.integers(
            own_steps(member, plan.max_step, plan.stop_time), loop_end, is_iterated, len(strings)
        ),
        *(encoding.integers(description.slots[n].reference) + encoding.text(value) for n, value in strings),
        encoding.ports(description, parameters),
        encoding.integers(*(row for _, row in given)),
        *(encoding.inputs(description, names, parameters) for names in (plain, held)),
        _feeds(network, plan, [Place(number, name) for name in (*plain, *held)]),
        encoding.ports(description, [place.name for place in signals if place.member == number]),
        encoding.ports(description, [place.name for place, _ in recorded]),
        encoding.integers(*(row for _, row in recorded)),
    ]
    return b"".join(parts)


def own_steps(member: Member, step: float, stop_time: float) -> int:
    """Return the number of communication steps in a component's own step.

    Args:
        member: the component.
        step: communication step in s.
        stop_time: end of the simulation in s.

    Raises:
        SpecError: if the own step is longer than the simulation or no integer multiple of the communication
            step; names the component and steps that fit.
    """
    own, key = member.step, f"components.{member.name}.step"
    if own is None:
        return 1
    if own > stop_time * (1.0 + GRID_ROUNDING):
        raise SpecError(
            f"{own:g} s is longer than the simulation, which stops at {stop_time:g} s; the component would "
            "never step; shorten its step",
            key=key,
        )
    count = max(round(own / step), 1)
    if abs(own / step - count) > GRID_ROUNDING * count:
        raise SpecError(
            f"{own:g} s is not an integer multiple of the communication step {step:g} s; set step_size = "
            f"{own / (count + (own > count * step)):.12g}, or another step here",
            key=key,
        )
    return count


def _is_held(description: Description, interface: Interface, name: str) -> bool:
    """Whether an input may change only at events."""
    variable = description.info[name]
    if interface == "co-simulation":
        return description.major == 3 and description.event_mode and variable.variability != "continuous"
    return not variable.is_continuous


def _feeds(network: Network, plan: Plan, targets: Sequence[Place]) -> bytes:
    """Return where the value of each of these inputs comes from, and how it is converted."""
    signals, sources = _connected_outputs(network), _sources_of(network, plan)
    rows = {network.places[name]: row for row, name in enumerate(plan.inputs)}
    links = {link.target: link for link in network.links}
    parts = []
    for target in targets:
        source, link = sources[target], links.get(target)
        row = signals[source] if source in signals else rows[source]
        numbers = (1.0, 0.0, 0.0) if link is None else (link.factor, link.offset, link.start)
        is_linear = link is not None and link.is_linear
        parts.append(
            encoding.integers(source in signals, row)
            + encoding.reals(*numbers)
            + encoding.integers(is_linear)
        )
    return b"".join(parts)
