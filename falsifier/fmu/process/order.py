"""What workers are asked to simulate, in bytes.

``falsifier/fmu/worker/system/request.c`` is the other side. Components come in the order in which they step.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from falsifier.core.experiment import GRID_ROUNDING, whole_steps
from falsifier.core.model import Interface
from falsifier.errors import SpecError
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.process import encoding
from falsifier.fmu.process.network import SYSTEM, Member, Network, Place
from falsifier.fmu.process.plan import Plan
from falsifier.fmu.process.rights import Rights

# Relative, of the solver (model exchange).
_DEFAULT_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What a new worker needs to know."""

    network: Network  # what it simulates
    key: Hashable  # what tells models apart that cannot share a process
    logging: bool  # whether to ask the FMUs for messages
    rights: Rights  # what the FMUs may do
    through_wine: bool = False  # whether to simulate the library for Windows

    def load(self, folder: Path, *, logging: bool) -> bytes:
        """Return the request to load what was unpacked; ModelError if an FMU has nothing for this machine."""
        network = self.network
        options = {"logging": logging, "through_wine": self.through_wine}
        parts = (encoding.fmu(network.members[k], folder / str(k), **options) for k in network.order)
        return encoding.integers(network.coupling.isolation == "each", len(network.order)) + b"".join(parts)

    def prepare(self, plan: Plan) -> bytes:
        """Return the request to prepare for a plan's simulations; SpecError as of ``own_steps``."""
        network, experiment = self.network, plan.experiment
        coupling, signals, feeds = network.coupling, network.connected_outputs(), _feeds(network, plan)
        steps = any(m.interface == "co-simulation" or m.step is not None for m in network.members)
        # Solvers that exchange nothing stop at the output grid only.
        every = plan.every if steps or network.links else 1
        sizes = (len(plan.parameters), len(plan.inputs), len(experiment.outputs))
        outputs = [(network.places[name], row) for row, name in enumerate(experiment.outputs)]
        copies = [(signals[place], row) for place, row in outputs if place in signals]
        parts = [
            encoding.integers(
                experiment.samples, every, plan.pieces, *sizes, experiment.tolerance is not None
            ),
            encoding.reals(experiment.stop_time, experiment.step, experiment.tolerance or 0.0),
            encoding.integers(coupling.method == "jacobi", coupling.max_rounds),
            encoding.reals(coupling.tolerance),
            encoding.integers(len(signals)),
            *(_component(network, plan, position, feeds) for position in range(len(network.order))),
            encoding.integers(len(copies), *(number for pair in copies for number in pair)),
        ]
        return b"".join(parts)


def _feeds(network: Network, plan: Plan) -> dict[Place, bytes]:
    """Return where the value of each input with a source comes from, and how it is converted."""
    signals = network.connected_outputs()
    rows = {network.places[name]: row for row, name in enumerate(plan.inputs)}
    found = {}
    for link in network.links:
        is_signal = link.source in signals
        row = signals[link.source] if is_signal else rows[link.source]
        numbers = encoding.reals(link.factor, link.offset, link.start)
        found[link.target] = encoding.integers(is_signal, row) + numbers + encoding.integers(link.is_linear)
    for place, row in rows.items():
        if place.member != SYSTEM:
            found[place] = encoding.integers(0, row) + encoding.reals(1.0, 0.0, 0.0) + encoding.integers(0)
    return found


def _component(network: Network, plan: Plan, position: int, feeds: Mapping[Place, bytes]) -> bytes:
    number, signals = network.order[position], network.connected_outputs()
    member, experiment = network.members[number], plan.experiment
    strings, description = network.of_member(number, experiment.strings), member.description
    given = network.of_member(number, zip(plan.parameters, count()))
    recorded = network.of_member(number, zip(experiment.outputs, count()))
    recorded = [(name, row) for name, row in recorded if Place(number, name) not in signals]
    inputs = [place.name for place in feeds if place.member == number]
    held = [name for name in inputs if _is_held(description, member.interface, name)]
    plain = [name for name in inputs if name not in held]
    parameters = [name for name, _ in given]
    loop_end = dict(network.loops).get(position, 0)
    is_iterated = any(first <= position < last for first, last in network.loops)
    own = own_steps(member, experiment.step, experiment.stop_time)
    parts = [
        encoding.reals(experiment.tolerance or description.info.tolerance or _DEFAULT_TOLERANCE),
        encoding.integers(own, loop_end, is_iterated, len(strings)),
        *(encoding.integers(description.slots[n].reference) + encoding.text(value) for n, value in strings),
        encoding.ports(description, parameters),
        encoding.integers(*(row for _, row in given)),
        *(encoding.inputs(description, names, parameters) for names in (plain, held)),
        *(feeds[Place(number, name)] for name in (*plain, *held)),
        encoding.ports(description, [place.name for place in signals if place.member == number]),
        encoding.ports(description, [name for name, _ in recorded]),
        encoding.integers(*(row for _, row in recorded)),
    ]
    return b"".join(parts)


def own_steps(member: Member, step: float, stop_time: float, *, stated_as: str = "step_size") -> int:
    """Return the number of communication steps, of this many s, in a component's own step.

    Raises:
        SpecError: if the own step is longer than the simulation or no integer multiple of the communication
            step; names the component and steps that fit.
    """
    own, key = member.step, f"components.{member.name}.step"
    if own is None:
        return 1
    if own > stop_time * (1.0 + GRID_ROUNDING):
        raise SpecError(
            f"{own:g} s is longer than the simulation, which stops at {stop_time:.10g} s; the component "
            "would never step; shorten its step",
            key=key,
        )
    return whole_steps("step", own, stated_as, step, key=key)


def _is_held(description: Description, interface: Interface, name: str) -> bool:
    """Whether an input may change only at events."""
    variable = description.info[name]
    if interface == "co-simulation":
        return description.major == 3 and description.event_mode and variable.variability != "continuous"
    return not variable.is_continuous
