"""State charts: states, transitions and data, whether the file nests them or lists them one by one."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from falsifier.context.simulink.diagram import Chart, ChartData, State, Transition
from falsifier.context.simulink.sections import Node

_MAX_NESTING = 100  # of states
_KINDS = ("state", "transition", "data", "junction")
_SCOPE = re.compile(r"(?P<scope>\w+?)(_DATA)?$")
_INTEGER = re.compile(r"-?\d+")


class _Item(NamedTuple):
    """A state, transition, junction or variable, and its number within the chart."""

    node: Node
    key: str
    parent: str  # number of the state around it; empty if there is none


def read_charts(tree: Node) -> Iterator[Chart]:
    """Return the charts of a file in the order in which it has them."""
    # Items of older files stand beside their charts, and name what they are in by its number.
    beside: dict[str, list[Node]] = {}
    for child in (child for node in tree.walk() if node.kind == "Stateflow" for child in node.children):
        beside.setdefault(_parent(child), []).append(child)
    for node in tree.walk():
        if node.kind == "chart":
            yield _chart(node, list(_items(node, beside)))


def _items(chart: Node, beside: Mapping[str, list[Node]]) -> Iterator[_Item]:
    waiting = [_Item(chart, "", "")]
    seen = {""}  # numbers; what a damaged file puts into itself is not followed again
    while waiting:
        around = waiting.pop()
        if around.node is not chart:
            yield around
        number = around.node.get("id")
        listed = () if number in seen else beside.get(number, ())
        seen.add(number)
        inner = [child for child in (*around.node.children, *listed) if child.kind in _KINDS]
        waiting += [_Item(child, child.get("SSID", "id"), around.key) for child in reversed(inner)]


def _parent(node: Node) -> str:
    """Number of what an item of an older file is in: the first number of its position in the tree."""
    found = _INTEGER.search(node.get("treeNode", "linkNode"))
    return found[0] if found else node.get("chart")


def _chart(node: Node, items: list[_Item]) -> Chart:
    states = {item.key: item for item in items if item.node.kind == "state" and not _is_note(item.node)}
    names = {key: _full_name(key, states) for key in states}
    junctions = [item.key for item in items if item.node.kind == "junction"]
    names |= {key: f"junction {i}" for i, key in enumerate(junctions, start=1) if key not in names}
    # The one state of a MATLAB Function block.
    kernels = (item.node for item in items if item.node.get("labelString").startswith("eML_blk_kernel"))
    code = next(filter(None, map(_script, kernels)), "")
    data = (item.node for item in items if item.node.kind == "data")
    # Not those of graphical functions.
    own = (each for each in data if not each.get("scope").startswith("FUNCTION_"))
    sample = node.get("sampleTime")
    return Chart(
        name=" ".join(node.get("name").split()),
        states=() if code else tuple(_state(item, names[key]) for key, item in states.items()),
        transitions=() if code else tuple(_transitions(items, names)),
        data=tuple(map(_data, own)),
        script=code,
        sample_time="" if sample == "-1" else sample,
    )


def _full_name(key: str, states: Mapping[str, _Item]) -> str:
    names: list[str] = []
    while key in states and len(names) <= _MAX_NESTING:
        names.append(states[key].node.get("labelString", "name").strip().split("\n")[0].strip().rstrip("/"))
        key = states[key].parent
    return ".".join(reversed(names))


def _state(item: _Item, name: str) -> State:
    rest = item.node.get("labelString").strip().split("\n")[1:]
    actions = "\n".join(line.strip() for line in rest if line.strip()) or _script(item.node)
    return State(name, actions, item.node.get("type") == "AND_STATE")


def _transitions(items: list[_Item], names: Mapping[str, str]) -> Iterator[Transition]:
    for item in items:
        if item.node.kind != "transition":
            continue
        ends = (item.node.first(side) for side in ("src", "dst"))
        source, target = ("" if end is None else names.get(end.get("SSID", "id"), "") for end in ends)
        label = item.node.get("labelString").strip()
        if target:
            yield Transition(source, target, "" if label == "?" else " ".join(label.split()))


def _data(node: Node) -> ChartData:
    scope = _SCOPE.match(node.get("scope") or "LOCAL_DATA")
    initial = next((n.get("initialValue") for n in node.walk() if n.get("initialValue")), "")
    return ChartData(node.get("name"), scope["scope"].lower() if scope else "", initial)


def _script(node: Node) -> str:
    inner = node.first("eml")
    return ("" if inner is None else inner.get("script")).strip()


def _is_note(node: Node) -> bool:
    inner = node.first("noteBox")
    return node.get("isNoteBox") == "1" or (inner is not None and inner.get("isNoteBox") == "1")
