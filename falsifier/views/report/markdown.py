"""The report as Markdown, short enough for a pull request."""

from pathlib import Path

from falsifier.core.literals import markdown_code, markdown_text, one_line
from falsifier.views.report.content import Content, Section, gather, replay_command, run_command


def markdown_report(directory: Path) -> str:
    """Summary of a run or a campaign.

    Raises:
        JournalError: when the directory is neither, or is damaged.
    """
    content = gather(directory)
    parts = [f"# Falsification report: {markdown_text(content.title)}", content.table.markdown().rstrip()]
    parts += [_section(section) for section in content.sections if any(r.falsified for r in section.runs)]
    return "\n\n".join([*parts, _environment(content)]) + "\n"


def _section(section: Section) -> str:
    """A falsified requirement with the counterexample that took the fewest simulations."""
    run = min((run for run in section.runs if run.falsified), key=lambda run: run.simulations)
    lines = [f"## {markdown_text(section.name)}: falsified", markdown_code(section.formula)]
    if run.verdict is not None:
        lines.append(
            f"Robustness {run.verdict.robustness:+.6g} at t = {run.verdict.critical_time:.6g} s, "
            f"{markdown_code(run.verdict.predicate)}, after {run.simulations} simulations of "
            f"{markdown_text(run.method.label)}, seed {run.seed}."
        )
    lines += [f"    {one_line(c)}" for c in (replay_command(run), run_command(run.manifest.request))]
    return "\n\n".join(lines)


def _environment(content: Content) -> str:
    if not content.runs:
        return "No run has begun."
    manifest = content.runs[0].manifest
    packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
    return f"falsifier {manifest.falsifier}, Python {manifest.python}, {manifest.platform}, {packages}."
