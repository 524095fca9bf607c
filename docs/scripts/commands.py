"""The command-line reference, made from the commands themselves: ``<!-- commands -->`` on a page."""

from collections.abc import Iterator
from inspect import cleandoc
from typing import Any

import click

from falsifier.cli import cli

_MARK = "<!-- commands -->"
_UNWRAPPED = "\b\n"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the mark of a page by all commands."""
    if _MARK not in markdown:
        return markdown
    root = click.Context(cli, info_name="falsifier")
    return markdown.replace(_MARK, "\n\n".join(_described(root)))


def _described(context: click.Context) -> Iterator[str]:
    """Parts of the page, one command after the other; groups are described by their commands."""
    group = context.command
    assert isinstance(group, click.Group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None, f"{name} is listed and cannot be had"
        below = click.Context(command, info_name=name, parent=context)
        if isinstance(command, click.Group):
            yield from _described(below)
            continue
        yield f"## {below.command_path.removeprefix('falsifier ')}"
        yield f"```\n{below.command_path} {' '.join(command.collect_usage_pieces(below))}\n```"
        yield from _paragraphs(command.help or "")
        options = [p for p in command.params if isinstance(p, click.Option)]
        records = [record for p in options if (record := p.get_help_record(below))]
        rows = [f"| `{names}` | {_cell(text)} |" for names, text in records]
        yield "\n".join(["| option | meaning |", "| --- | --- |", *rows]) if rows else "No options."


def _paragraphs(text: str) -> Iterator[str]:
    """Help of a command; what click is told not to wrap is code."""
    for paragraph in cleandoc(text).split("\n\n"):
        if paragraph.startswith(_UNWRAPPED):
            yield f"```\n{paragraph.removeprefix(_UNWRAPPED)}\n```"
        else:
            yield paragraph


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("  [", " [")
