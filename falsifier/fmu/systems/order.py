"""A system as its workers get it, and what their replies say of it in words."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from falsifier.errors import FalsifierError, SimulationError
from falsifier.fmu.process import Plan, Policy, Reply, Request, Room, Where, outcome, value_checks
from falsifier.fmu.systems import request
from falsifier.fmu.systems.network import Network


@dataclass(frozen=True, slots=True, eq=False)
class SystemOrder:
    """A system to simulate; see Order.

    Attributes:
        network: the system.
        system: hash of everything that determines its trajectories.
        logging: whether to ask the FMUs for messages.
        policy: what they may do.
    """

    network: Network
    system: str
    logging: bool = False
    policy: Policy = field(default_factory=Policy)

    @property
    def name(self) -> str:
        """See Order."""
        return self.network.name

    @property
    def path(self) -> Path:
        """See Order."""
        return Path(self.network.name)

    @property
    def key(self) -> Hashable:
        """See Order."""
        return self.system, self.logging, self.policy

    @property
    def archives(self) -> Mapping[str, tuple[Path, str]]:
        """See Order."""
        return {m.folder: (m.path, m.sha256) for m in self.network.members}

    @property
    def through_wine(self) -> bool:
        """See Order."""
        return False

    @property
    def kind(self) -> Request:
        """See Order."""
        return Request.LOAD_SYSTEM

    def load(self, folder: Path, *, logging: bool) -> bytes:
        """See Order."""
        return request.load(self.network, folder, logging=logging)

    def prepare(self, plan: Plan) -> bytes:
        """See Order."""
        return request.prepare(self.network, plan)

    def checks(self, plan: Plan) -> Callable[[Room], None]:
        """See Order."""
        members = self.network.members
        parts = [request.part_of(self.network, plan, k) for k in range(len(members))]
        return value_checks(
            plan,
            [(m.description, part.parameters, part.driven) for m, part in zip(members, parts, strict=True)],
        )

    def failure(self, plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]) -> FalsifierError:
        """See Order."""
        said = self._said(plan, reply)
        if said:
            text = f"{said}{refusals}{outcome.last_lines(log)}"
            return SimulationError(text, time=max(reply.time, 0.0), log=log)
        name = self.component(reply.component)
        if reply.where == Where.TIMEOUT or not name:
            return outcome.failure(self.name, plan, reply, refusals, log)
        part = request.part_of(self.network, plan, self.network.order[reply.component])
        return outcome.failure(name, replace(plan, strings=part.strings), reply, refusals, log)

    def component(self, position: int) -> str:
        """See Order."""
        return self.network.stepped(position)

    def _said(self, plan: Plan, reply: Reply) -> str:
        """Say what only happens to systems; empty for all else."""
        name, rounds = self.component(reply.component), self.network.coupling.max_rounds
        reached = f"t = {reply.time:g} s"
        before = f"{reached}, before the stop time {plan.stop_time:g} s"
        if reply.where == Where.UNSETTLED:
            return (
                f"{self.name}: the initialisation does not converge: after {rounds} rounds through the "
                f"connections, these still change: {self._changes(reply)}; they depend on each other in a "
                "loop: give a component other start values or a delay, or raise coupling.max_rounds or "
                "coupling.tolerance"
            )
        if reply.where == Where.NOT_CONVERGED:
            return (
                f"{self.name}: the loop of {', '.join(self._loop(reply.component))} does not converge at "
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
        titles = [self.network.title(place) for place in request.connected_outputs(self.network)]
        known = [int(text) for text in positions if _is_position(text)]
        return [titles[k] for k in known if k < len(titles)]


def _is_position(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 10


def _short(number: str) -> str:
    try:
        return f"{float(number):.3g}"
    except ValueError:
        return "an unknown number"
