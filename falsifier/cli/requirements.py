"""``falsifier check`` and ``falsifier formalize``: what requirements say, before anything is searched."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.analyses.lint import LintFinding, lint
from falsifier.cli import options
from falsifier.cli.command import command
from falsifier.cli.files import in_existing_folder
from falsifier.cli.llm_options import connection_options, llm_option, llm_settings
from falsifier.cli.output import as_shown, conclude, say
from falsifier.core.files import bundled, write_whole
from falsifier.core.literals import one_line, shell_word
from falsifier.core.words import counted, ends, named, parameterization_text
from falsifier.errors import SpecError
from falsifier.problem.loading import load_source, sources_of
from falsifier.problem.problem import Problem, held_text
from falsifier.problem.templates import TEMPLATES
from falsifier.views.terminal import warn

if TYPE_CHECKING:  # writing specs takes a package that check does not need
    from falsifier.analyses.formalize import Formalized
    from falsifier.problem.writing import Subject


@command()
@options.target_argument
@options.parameterization_option()
@options.stl_option()
@options.budget_option(
    0, least=0, note=" to measure whether inputs affect a requirement; 0: rely on what the FMU declares"
)
@options.json_option
def check(*, budget: int, as_json: bool, **given: Any) -> None:
    """Check a spec file, and find requirements that say nothing.

    First, keys, signals, ranges and formulas are checked. Then it looks for parts that cannot fail or hold,
    signals that no input moves, windows and parts that do not matter, units that do not fit, and requirements
    that repeat others. With --stl, only that requirement is checked; TARGET is then a spec or an FMU.

    Exit codes: 0 nothing was found, 1 something was, 2 wrong usage or spec.
    """
    source = options.problem_source(given)
    findings = lint(source, simulations=budget)
    invalid = {finding.requirement for finding in findings if finding.kind == "invalid"}
    code = 2 if invalid else 1 if findings else 0
    if as_json:
        conclude(as_shown("", [asdict(finding) for finding in findings], as_json=True), code)
    sources = [source] if source.stl is not None else sources_of(source)
    problems = [load_source(each) for each in sources if each.name not in invalid]
    for finding in findings:
        if finding.requirement in invalid:
            warn(f"falsifier: {finding.text}")
    lines = list(map(_problem_line, problems))
    lines += dict.fromkeys(f"note: {note}" for problem in problems for note in problem.notes)
    held = dict.fromkeys(held_text(problem.held_inputs) for problem in problems)
    lines += [f"not searched: {text}" for text in held if text]
    lines += [line for finding in findings if finding.kind != "invalid" for line in _lines(finding)]
    lines.append(f"{counted(len(findings), 'finding')}" if findings else "nothing found")
    conclude("\n".join(map(one_line, lines)), code)


def _problem_line(problem: Problem) -> str:
    space = problem.space
    shown = {}
    for r in space.ranges:
        low, high = (named(end, r.kind, r.items) for end in ends(r.low, r.high))
        shown[r.name] = f"{r.name} [{low}, {high}]{r.manner}"
    searched = [f"{shown[r.name]} {parameterization_text(r)}" for r in space.inputs]
    searched += [shown[p.name] for p in space.parameters]
    return f"{problem.name}: ok, {problem.requirement.formula}; searches {', '.join(searched)}"


def _lines(finding: LintFinding) -> list[str]:
    place = [f"  in      {finding.part}"] if finding.part else []
    return [f"{finding.requirement}: {finding.kind}: {finding.text}", *place, f"  to do   {finding.advice}"]


@command()
@click.argument("target", metavar="MODEL")
@click.argument("sentence")
@llm_option()
@connection_options
@click.option("--choose", type=click.IntRange(1), metavar="N", help="Write reading N into the spec.")
@options.out_option("Spec file to write; default: MODEL if it is a spec, else NAME.toml beside the FMU.")
def formalize(*, target: str, sentence: str, choose: int | None, out: Path | None, **given: Any) -> None:
    """Turn a requirement in words into formulas, and write the chosen one into a spec.

    MODEL is an FMU, a spec or a bundled name. A language model answers with one to three readings; each is
    checked, restated in words, distinguished from the others by an example and judged on one simulation.
    Without a language model, use a template: --stl 'NAME argument=value ...' of run and other commands.
    """
    from falsifier.problem.writing import subject_of
    from falsifier.views.analyses_text import formalized_text

    settings = llm_settings(given)
    if settings is None:
        raise SpecError(
            f"formalize needs --llm NAME, which proposes the readings; or choose a template "
            f"({', '.join(TEMPLATES)}), as --stl 'settles signal=speed reference=80 within=2% time=3'"
        )
    if choose is not None or out is not None:  # before anything is paid for
        _file(subject_of(target), out)
    from falsifier.analyses.formalize import formalize as ask

    warn(f"asking {settings.told}")
    found = ask(target, sentence, settings)
    say(formalized_text(found))
    if choose is None:
        say("to write one of them into the spec, repeat the command with --choose N")
    else:
        file, name = _write(found, choose, out)
        say(f"{file}: requirement {name} written; to search: falsifier run {shell_word(f'{file}:{name}')}")


def _write(found: "Formalized", number: int, out: Path | None) -> tuple[str, str]:
    """Write a reading into the spec; return the file and the requirement's name."""
    from falsifier.problem.writing import subject_of, with_requirement

    if number > len(found.readings):
        raise SpecError(f"--choose {number}: expected 1 to {len(found.readings)}, the number of a reading")
    file = _file(found.subject, out)
    formula = str(found.readings[number - 1].formula)
    # A spec may have been edited while the language model was asked.
    subject = found.subject if found.subject.is_new else subject_of(str(found.subject.path))
    text, name = with_requirement(subject, file, formula, description=found.sentence)
    write_whole(file, text)
    return str(file), name


def _file(subject: "Subject", out: Path | None) -> Path:
    if out is None and subject.path.parent == bundled("specs"):
        raise SpecError("a bundled spec is not changed: give another file with --out")
    file = out or subject.path
    if file.exists() and (subject.is_new or file.resolve() != subject.path.resolve()):
        raise SpecError(f"{file} already exists: choose another --out, or give it as MODEL to add to it")
    return in_existing_folder(file)
