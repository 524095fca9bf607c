"""The command-line reference, made from the commands themselves.

``<!-- command list -->`` on a page becomes a list of all commands and one of all options,
``<!-- commands -->`` a section per command.
"""

from collections.abc import Iterator
from inspect import cleandoc
from typing import Any

import click
from tables import table

from falsifier.cli import cli
from falsifier.cli.command import OPTION_GROUPS, option_groups

_LIST, _MARK = "<!-- command list -->", "<!-- commands -->"
_UNWRAPPED = "\b\n"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks of a page by all commands."""
    if _MARK not in markdown:
        return markdown
    contexts = list(_commands(click.Context(cli, info_name="falsifier")))
    sections = "\n\n".join(part for context in contexts for part in _described(context))
    return markdown.replace(_LIST, _listed(contexts)).replace(_MARK, sections)


def _commands(context: click.Context) -> Iterator[click.Context]:
    """Contexts of all commands below one, those of groups after another."""
    group = context.command
    assert isinstance(group, click.Group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None, f"{name} is listed and cannot be had"
        below = click.Context(command, info_name=name, parent=context)
        yield from _commands(below) if isinstance(command, click.Group) else (below,)


def _name(context: click.Context) -> str:
    return context.command_path.removeprefix("falsifier ")


def _listed(contexts: list[click.Context]) -> str:
    """A table of the commands, and one of the options by heading."""
    rows = [
        (f"[`{_name(c)}`](#{_name(c).replace(' ', '-')})", c.command.get_short_help_str(200))
        for c in contexts
    ]
    users: dict[str, list[str]] = {}
    for context in contexts:
        for parameter in context.command.params:
            if isinstance(parameter, click.Option):
                users.setdefault(parameter.opts[-1], []).append(_name(context))
    grouped = {name for names in OPTION_GROUPS.values() for name in names}
    own = sorted(users.keys() - grouped)
    headings = {**OPTION_GROUPS, "Of single commands": own}
    options = [
        (heading, ", ".join(f"`{name}`" for name in names if name in users))
        for heading, names in headings.items()
    ]
    count = f"{len(users)} options; each means the same in every command that has it."
    return "\n\n".join([table(("command", "does"), rows), count, table(("heading", "options"), options)])


def _described(context: click.Context) -> Iterator[str]:
    """Parts of the page about one command."""
    command = context.command
    yield f"## {_name(context)}"
    yield f"```\n{context.command_path} {' '.join(command.collect_usage_pieces(context))}\n```"
    yield from _paragraphs(command.help or "")
    for heading, records in option_groups(command, context):
        rows = [f"| `{names}` | {_cell(text)} |" for names, text in records if "--help" not in names]
        if rows:
            yield "\n".join([f"| {heading.lower()} | meaning |", "| --- | --- |", *rows])


def _paragraphs(text: str) -> Iterator[str]:
    """Help of a command; what click is told not to wrap is code."""
    for paragraph in cleandoc(text).split("\n\n"):
        if paragraph.startswith(_UNWRAPPED):
            yield f"```\n{paragraph.removeprefix(_UNWRAPPED)}\n```"
        else:
            yield paragraph


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("  [", " [")
