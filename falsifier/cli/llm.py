"""``falsifier prompt`` and ``falsifier llm``: what a language model is sent, and whether it answers."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.cli.options import json_option, problem_options, problem_source
from falsifier.cli.output import say
from falsifier.problem.loading import load_source

if TYPE_CHECKING:
    from falsifier.llm.messages import Message, Tool


@click.command()
@problem_options
@click.option("--variant", metavar="MP1..", help="Prompt variant; default: the one that runs use.")
@click.option("--anonymous", is_flag=True, help="With neutral names only.")
@click.option(
    "--run", "directory", type=click.Path(path_type=Path), help="Show the prompt behind this run's samples."
)
@click.option("--samples", type=int, help="With --run: only its first samples.")
@click.option(
    "--engine",
    type=click.Choice(["llm", "hybrid"]),
    default="llm",
    show_default=True,
    help="Who asks; hybrid: for several candidates at a time, with the tool that it offers.",
)
@json_option
def prompt(
    *,
    variant: str | None,
    anonymous: bool,
    directory: Path | None,
    samples: int | None,
    engine: str,
    as_json: bool,
    **options: Any,
) -> None:
    """Print exactly what would be sent next; send nothing."""
    from falsifier.engines.hybrid import Settings as HybridSettings
    from falsifier.engines.llm import preview, preview_tool
    from falsifier.search.journal import read_journal, recorded_evaluations

    if samples is not None and directory is None:
        raise click.UsageError("--samples needs --run DIR")
    problem = load_source(problem_source(options))
    evaluations = recorded_evaluations(directory, read_journal(directory)) if directory else []
    told = evaluations[:samples]
    settings = HybridSettings()
    count = 1 if engine == "llm" else settings.count if told else settings.opening
    messages = preview(problem, variant=variant, evaluations=told, count=count, anonymous=anonymous)
    tools: tuple[Tool, ...] = ()
    if engine == "hybrid" and told:
        tools = (preview_tool(problem, calls=settings.what_if_calls, variant=variant, anonymous=anonymous),)
    say(_as_json(messages, tools) if as_json else _as_text(messages, tools))


def _as_json(messages: Sequence["Message"], tools: Sequence["Tool"]) -> str:
    sent = [message.model_dump() for message in messages]
    return json.dumps(
        {"messages": sent, "tools": [t.model_dump() for t in tools]} if tools else sent, indent=2
    )


def _as_text(messages: Sequence["Message"], tools: Sequence["Tool"]) -> str:
    parts = [f"--- {message.role} ---\n{message.content}" for message in messages]
    if tools:
        parts.append(
            "(The engine adds why it asks, and what its numerical model expects, to the last message.)"
        )
    parts += [
        f"--- tool {tool.name}, offered while the engine's forecasts are good ---\n{tool.description}\n"
        f"arguments: {json.dumps(tool.parameters)}"
        for tool in tools
    ]
    return "\n\n".join(parts)


@click.group()
def llm() -> None:
    """Language models."""


@llm.command()
@click.argument("name")
@click.option("--api-base", metavar="URL", help="Address of an OpenAI-compatible server.")
@click.option("--effort", type=click.Choice(["low", "medium", "high"]), help="Reasoning effort of the LLM.")
def check(*, name: str, api_base: str | None, effort: str | None) -> None:
    """Check the language model NAME: its name, its key and one small round trip, and say what it costs."""
    from falsifier.llm.connect import check_llm

    found = check_llm(name, api_base=api_base, effort=effort)
    price = "unknown" if found.price is None else str(found.price)
    key = f"key from {found.key}" if found.key else "no key needed"
    say(
        f"{found.llm}: answers ({found.reply!r} after {found.seconds:.1f} s, {found.usage.tokens} tokens); "
        f"{key}; price {price}"
    )
