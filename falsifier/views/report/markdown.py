"""The report as Markdown, short enough for a pull request."""

from pathlib import Path

from falsifier.core.words import counted
from falsifier.views.report.content import Content, Section, gather, replay_command, run_command


def markdown_report(directory: Path) -> str:
    """Summarize a run or a campaign.

    Raises:
        JournalError: if the directory is neither, or is damaged.
    """
    content = gather(directory)
    parts = [f"# Falsification report: {content.title}", content.table.markdown().rstrip()]
    parts += [_section(section) for section in content.sections if any(r.falsified for r in section.runs)]
    return "\n\n".join([*parts, _environment(content)]) + "\n"


def _section(section: Section) -> str:
    """A falsified requirement, with the counterexample found in the fewest simulations."""
    run = min((run for run in section.runs if run.falsified), key=lambda run: run.simulations)
    lines = [f"## {section.name}: falsified", f"`{_inline(section.formula)}`"]
    if run.verdict is not None:
        lines.append(
            f"Robustness {run.verdict.robustness:+.6g} at t = {run.verdict.critical_time:.6g} s, "
            f"decided by `{_inline(run.verdict.predicate)}`, after {counted(run.simulations, 'simulation')} "
            f"with {run.method.label}, seed {run.seed}."
        )
    repeat = run_command(run.manifest.request, shared=run.shared)
    lines.append(f"```sh\n{replay_command(run)}\n{repeat}\n```")
    return "\n\n".join(lines)


def _environment(content: Content) -> str:
    if not content.runs:
        return "No run has started yet."
    manifest = content.runs[0].manifest
    packages = ", ".join(f"{name} {version}" for name, version in manifest.packages.items())
    return f"falsifier {manifest.falsifier}, Python {manifest.python}, {manifest.platform}, {packages}."


def _inline(text: str) -> str:
    return " ".join(text.replace("`", "'").split())
