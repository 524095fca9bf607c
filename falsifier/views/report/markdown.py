"""The report as Markdown, in the order of the page and short enough for a pull request."""

from collections.abc import Iterable
from pathlib import Path

from falsifier.core.literals import markdown_code, markdown_text, one_line, shell_word
from falsifier.views.report import wording
from falsifier.views.report.content import Section, Shown, Side, by_requirement, gather, spent_on
from falsifier.views.text import Fact, llm_use


def markdown_report(*directories: Path) -> str:
    """Summarize runs or campaigns, and compare several; JournalError if one is neither, or is damaged."""
    sides = gather(*directories)
    parts = [f"# Falsification report: {markdown_text(' and '.join(side.title for side in sides))}"]
    for name, sections in by_requirement(sides).items():
        for side, section in zip(sides, sections, strict=True):
            where = f" in {markdown_text(side.title)}" if len(sections) > 1 else ""
            if section is None:
                parts.append(f"## {markdown_text(name)}{where}: not searched")
            else:
                parts += _verdict(section, where)
    if len(sides) > 1:
        parts.append(wording.differences(sides).markdown().rstrip())
    for side in sides:
        if side.table is not None:
            parts += [f"## Statistics: {markdown_text(side.title)}", side.table.markdown().rstrip()]
    for side in sides:
        whose = f"{markdown_text(side.title)}: " if len(sides) > 1 else ""
        if (spent := spent_on(side.runs)).questions:
            parts.append(f"{whose}Language model: {llm_use(spent)}.")
        parts.append(f"{whose}{_environment(side)}")
    return "\n\n".join(parts) + "\n"


def _verdict(section: Section, where: str) -> list[str]:
    """What a card of the page shows, without its picture."""
    result = markdown_text(wording.result_text(section))
    parts = [
        f"## {markdown_text(section.heading)}{where}: {section.status}",
        markdown_text(section.sentence),
        f"**{result[:1].upper()}{result[1:]}.**",
    ]
    if section.shown:
        parts += _found(section.shown[0])
    if section.status != "violated":
        parts += _listed("What was tried", (f"{name}: {text}" for name, text in wording.tried(section)))
        parts += _listed("What this does not show", wording.unshown_lines(section))
    parts += _listed("Incomplete runs and unconfirmed violations", wording.trouble_lines(section))
    parts.append(markdown_code(section.formula))
    if section.shown:
        listing = "\n".join(one_line(command) for _, command in wording.commands(section.shown[0]))
        parts.append(f"```sh\n{listing}\n```")
    return parts


def _found(shown: Shown) -> list[str]:
    parts = [f"The {shown.what}:"]
    if shown.verdict:
        parts.append(_facts(wording.limit_facts(shown)))
    if shown.candidate.signals:
        parts.append(wording.input_table(shown).markdown().rstrip())
    if shown.candidate.parameters:
        parts.append(_facts(wording.parameter_facts(shown)))
    if shown.explanation:
        parts.append(markdown_text(shown.explanation))
    if shown.confirmed:
        parts.append(f"Confirmed: {markdown_text(shown.confirmed)}.")
    if beside := wording.margin_beside(shown):
        parts.append(_facts(beside))
    advice = wording.advice(shown)
    if shown.run.spent.questions:  # too long for a text
        page = f"falsifier report {shell_word(shown.run.directory)}"
        advice.append(("To see the questions to the language model", page))
    parts += [f"{what}: {markdown_code(command)}" for what, command in advice]
    return parts


def _facts(facts: Iterable[Fact]) -> str:
    return "\n".join(f"- {markdown_text(f'{name}: {text}' if name else text)}" for name, text in facts)


def _listed(title: str, lines: Iterable[str]) -> list[str]:
    items = [f"- {markdown_text(line)}" for line in lines]
    return ["\n".join([f"{title}:", "", *items])] if items else []


def _environment(side: Side) -> str:
    if not side.runs:
        return "No run has started yet."
    told = dict.fromkeys(  # runs of several machines may differ
        f"falsifier {m.falsifier}, Python {m.python}, {m.platform}, "
        + ", ".join(f"{name} {version}" for name, version in m.packages.items())
        for m in (run.manifest for run in side.runs)
    )
    return f"{markdown_text('; '.join(told))}."
