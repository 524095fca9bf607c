"""Ways to ask for JSON, from the strictest to the plainest."""

from typing import Literal, get_args

Mode = Literal["json_schema", "json_object", "prompt"]
MODES: tuple[Mode, ...] = get_args(Mode)


def below(mode: Mode) -> Mode | None:
    """Next plainer way, or None."""
    rest = MODES[MODES.index(mode) + 1 :]
    return rest[0] if rest else None
