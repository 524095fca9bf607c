"""The report as Markdown, short enough for a pull request."""

from pathlib import Path

from falsifier.core.literals import markdown_code, markdown_text, one_line
from falsifier.core.words import counted
from falsifier.stl.margins import signed
from falsifier.views.report.content import (
    Content,
    Section,
    gather,
    replay_command,
    run_command,
    unshown_lines,
)


def markdown_report(directory: Path) -> str:
    """Summarize a run or a campaign.

    Raises:
        JournalError: if the directory is neither, or is damaged.
    """
    content = gather(directory)
    parts = [f"# Falsification report: {markdown_text(content.title)}", content.table.markdown().rstrip()]
    parts += [_section(section) for section in content.sections if any(r.falsified for r in section.runs)]
    parts += [_unshown(section) for section in content.sections if unshown_lines(section)]
    return "\n\n".join([*parts, _environment(content)]) + "\n"


def _unshown(section: Section) -> str:
    """What the searches of a requirement could not show."""
    items = [f"- {markdown_text(one_line(line))}" for line in unshown_lines(section)]
    return "\n".join([f"## {markdown_text(section.heading)}: what this does not show", "", *items])


def _section(section: Section) -> str:
    """A falsified requirement, with the counterexample found in the fewest simulations."""
    run = min((run for run in section.runs if run.falsified), key=lambda run: run.simulations)
    lines = [f"## {markdown_text(section.heading)}: falsified", markdown_code(section.formula)]
    if run.verdict is not None:
        if run.verdict.breach is not None:
            lines.append(f"What broke: {markdown_text(one_line(run.verdict.breach.text))}.")
        lines.append(
            f"Robustness {signed(run.verdict.robustness)} at t = {run.verdict.critical_time:.6g} s, "
            f"decided by {markdown_code(run.verdict.predicate)}, after "
            f"{counted(run.simulations, 'simulation')} with {markdown_text(run.method.label)}, "
            f"seed {run.seed}."
        )
    commands = (replay_command(run), run_command(run.manifest.request, shared=run.shared))
    listing = "\n".join(map(one_line, commands))
    lines.append(f"```sh\n{listing}\n```")
    return "\n\n".join(lines)


def _environment(content: Content) -> str:
    if not content.runs:
        return "No run has started yet."
    manifest = content.runs[0].manifest
    packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
    return f"falsifier {manifest.falsifier}, Python {manifest.python}, {manifest.platform}, {packages}."
