"""The command line. The modules of commands are imported only when a command is used."""

import errno
import os
import sys
import traceback
from functools import partial
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any, NoReturn

import click

from falsifier import __version__
from falsifier.cli import output
from falsifier.core.posix import check_memory_limits
from falsifier.errors import FalsifierError, did_you_mean, reader, remedy, speak_to, without_middle
from falsifier.views.terminal import warn

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

# Exit code that a shell reports for a program whose pipe was closed: 128 + SIGPIPE.
_PIPE_CLOSED = 141
# Set by the shell when it asks for completions; falsifier completes by what click brings.
_COMPLETES = "_FALSIFIER_COMPLETE"

# name: (module, summary in --help). A group has a table of its own in place of a module.
_Table = dict[str, "tuple[str | _Table, str]"]
_LLM: _Table = {
    "check": ("falsifier.cli.llm", "Check a language model with a few short requests."),
    "prompt": ("falsifier.cli.llm", "Print the prompt that a language model would get, or was sent."),
}
_TOOLS: _Table = {
    "build": ("falsifier.cli.tools", "Compile an FMU's C sources for this platform."),
    "repair": ("falsifier.cli.tools", "Remove damaged parts from the files of a run or campaign."),
    "validate": ("falsifier.cli.tools", "Re-simulate counterexamples in ARCH-COMP format."),
    "schema": ("falsifier.cli.tools", "Print the JSON Schema of spec files or run records."),
}
_COMMANDS: _Table = {
    "run": ("falsifier.cli.run", "Search for inputs that violate a requirement."),
    "resume": ("falsifier.cli.run", "Continue an interrupted run or campaign."),
    "report": ("falsifier.cli.report", "Report on a run or campaign: HTML or Markdown."),
    "watch": ("falsifier.cli.campaign", "Follow a running search from another terminal."),
    "simulate": ("falsifier.cli.simulate", "Simulate your own inputs and judge the requirement."),
    "explain": ("falsifier.cli.counterexample", "Say why a counterexample violates; simplify it; map it."),
    "replay": ("falsifier.cli.counterexample", "Simulate a stored counterexample again."),
    "export": ("falsifier.cli.counterexample", "Write a counterexample for other tools."),
    "coverage": ("falsifier.cli.report", "Show what a run has tried, and what it has not."),
    "assess": ("falsifier.cli.assess", "Bound the probability of a violation."),
    "margin": ("falsifier.cli.assess", "Find the threshold at which violations begin."),
    "bench": ("falsifier.cli.campaign", "Run requirements x methods x seeds, and print a table."),
    "info": ("falsifier.cli.inspect", "Show an FMU's interfaces, variables, units and ranges."),
    "init": ("falsifier.cli.inspect", "Write a starter spec for an FMU."),
    "check": ("falsifier.cli.requirements", "Check a spec file, and find requirements that say nothing."),
    "formalize": ("falsifier.cli.requirements", "Turn a requirement in words into formulas."),
    "llm": (_LLM, "Check a language model, or print prompts."),
    "tools": (_TOOLS, "Build FMUs, repair records, validate results, print schemas."),
}

# Words that people try for what a command, or an option of one, does.
_WHERE = {"lint": "check", "shrink": "explain RUN --shrink", "map": "explain RUN --map", "plot": "report"}
_WHERE |= {"falsify": "run", "continue": "resume", "prompt": "llm prompt"}
_WHERE |= {name: f"tools {name}" for name in _TOOLS}


class _LazyGroup(click.Group):
    """Lists commands from a table and imports a command's module only when it is called."""

    def __init__(self, name: str | None = None, *, table: _Table, **attributes: Any) -> None:
        super().__init__(name, **attributes)
        self._table = table

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self._table:
            return None
        found, summary = self._table[cmd_name]
        if isinstance(found, dict):
            return _LazyGroup(cmd_name, table=found, help=summary)
        command: click.Command = getattr(import_module(found), cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self._table:
            where = _WHERE.get(args[0]) if self._table is _COMMANDS else None
            hint = f"use falsifier {where}" if where else did_you_mean(args[0], self._table)
            ctx.fail(f"No such command {args[0]!r}; {hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self._table.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> "list[CompletionItem]":
        """Complete names of commands without importing their modules."""
        from click.shell_completion import CompletionItem

        names = [
            CompletionItem(name, help=text)
            for name, (_, text) in self._table.items()
            if name.startswith(incomplete)
        ]
        return [*names, *click.Command.shell_complete(self, ctx, incomplete)]


_HELP = """Find inputs that make an FMU violate a requirement.

\b
falsifier run AT1                                      a bundled problem
falsifier run my.toml:REQ --budget 300                 your own requirement
falsifier run my.fmu --stl 'G[0,10] (h >= 0)' --search u=-1:1:5

Exit codes: 0 not falsified, 1 falsified, 2 wrong usage or spec, 3 simulator, language model or machine
failed, 130 interrupted.
"""


@click.command(
    cls=_LazyGroup, table=_COMMANDS, help=_HELP, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(__version__, prog_name="falsifier")
def cli() -> None:
    """Run the given command, whose messages speak of options; its help text is _HELP."""
    click.get_current_context().call_on_close(partial(speak_to, reader()))
    speak_to("command line")


def main() -> NoReturn:
    """Entry point; no error ends with exit code 1, which means falsified."""
    # The engines' matrices are small: threads of the linear algebra library would only slow them down.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    output.open_streams()
    output.stop_at_interrupts()
    code = _carried_out(sys.argv[1:])
    output.end_at_interrupts(code)
    output.settle_streams()
    sys.exit(code)


def _carried_out(arguments: list[str]) -> int:
    """Carry out a command; return its exit code."""
    try:
        if instruction := os.environ.get(_COMPLETES):
            from click.shell_completion import shell_complete

            return shell_complete(cli, {}, "falsifier", _COMPLETES, instruction)
        check_memory_limits()
        # Not cli.main: it ends with exit code 1, which means falsified, if a pipe is closed.
        with cli.make_context("falsifier", arguments) as context:
            cli.invoke(context)
        return 0
    except SystemExit as end:
        return output.FAILED if isinstance(end.code, str) else int(end.code or 0)
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.ClickException as error:
        shown = StringIO()
        error.show(shown)
        warn(without_middle(shown.getvalue().rstrip("\n")))
        return 2
    except (click.Abort, KeyboardInterrupt):
        warn("interrupted")
        return output.INTERRUPTED
    except FalsifierError as error:
        warn(f"falsifier: {error}")
        return error.exit_code
    except BrokenPipeError:  # who read the output has seen enough
        return _PIPE_CLOSED
    except OSError as error:
        return _report_refusal(error)
    except MemoryError:
        warn("falsifier: not enough memory; free some, or raise the limit (ulimit)")
        return output.FAILED
    except Exception as error:
        if "KeyboardInterrupt" in str(error):  # pydantic puts its name in place of it while it makes a class
            warn("interrupted")
            return output.INTERRUPTED
        warn(f"{traceback.format_exc()}falsifier: this is a defect of falsifier itself; please report it")
        return output.FAILED


def _report_refusal(error: OSError) -> int:
    """Print what the operating system refused; return the exit code."""
    where = "" if error.filename is None else f"{without_middle(str(error.filename))}: "
    if cure := remedy(error):
        warn(f"falsifier: {where}{error.strerror}{cure}")
    elif not where:
        gone = "if the current folder was deleted, change to another"
        if "temporary directory" in str(error):  # tempfile has tried all that it knows
            gone = "set TMPDIR to a folder that can be written to"
        warn(f"falsifier: {error}{f'; {gone}' if error.errno == errno.ENOENT else ''}")
    else:
        warn(f"falsifier: {where}{error.strerror}; choose a readable and writable location")
        return 2
    return output.FAILED
