"""The report as one self-contained HTML page, which runs no script and asks no network for anything."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from falsifier.campaigns.analysis import Run, Table, group
from falsifier.core.files import file_name
from falsifier.core.literals import shell_word
from falsifier.core.words import counted, readable
from falsifier.problem.problem import held_text
from falsifier.stl.margins import signed
from falsifier.views.exchanges import exchanges_html
from falsifier.views.html import Html, el, join, picture, table
from falsifier.views.plotting import plot_history, plot_panels, plot_rates, svg
from falsifier.views.report import wording
from falsifier.views.report.content import Section, Shown, Side, by_requirement, gather, spent_on
from falsifier.views.report.wording import run_name
from falsifier.views.text import Fact, llm_use

if TYPE_CHECKING:
    from falsifier.views.plotting import Figure

# Maximum number of runs of a requirement whose questions are shown, and of questions on the whole page, which
# should stay below a few MB, to be sent around.
_MOST_TALKS, _MOST_QUESTIONS = 3, 30
# Longer tables of inputs are folded.
_MOST_ROWS = 12
# Columns of the table of statistics that name a row, and those folded away so that the others fit on paper.
_KEYS = ("requirement", "method")
_FOLDED = ("median S", "std S", "sim. s", "total s", "tokens", "cost $")


def html_report(*directories: Path) -> str:
    """Report on runs or campaigns, several side by side; JournalError if one is neither, or is damaged."""
    sides = gather(*directories)
    title = " and ".join(side.title for side in sides)
    requirements = by_requirement(sides)
    asking = [sum(run.spent.questions > 0 for run in c.found) for side in sides for c in side.sections]
    most = max(1, _MOST_QUESTIONS // max(1, sum(min(_MOST_TALKS, count) for count in asking)))
    links = [el("li", el("a", name, href=f"#{_anchor(name)}")) for name in requirements]
    found = wording.differences(sides)
    differing = table(found.header, found.rows, label=found.title) if found.rows else el("p", "Nothing.")
    cards = [_verdicts(sides, name, told, most) for name, told in requirements.items()]
    return document(
        f"Falsification report: {title}",
        el("a", "Skip to the results", href="#verdicts", class_="skip"),
        el("header", el("h1", title), *(el("p", overview(side)) for side in sides)),
        el("nav", el("ul", *links), aria_label="Requirements") if len(links) > 1 else "",
        el(
            "main",
            el("div", *cards, id="verdicts"),
            el("section", el("h2", found.title), differing) if len(sides) > 1 else "",
            *map(_statistics, sides),
            *map(_environment, sides),
        ),
    )


def document(title: str, *body: str) -> str:
    """Return a page with the style of reports, whose policy forbids all scripts."""
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    style = Html(files("falsifier.views.report").joinpath("style.css").read_text(encoding="utf-8"))
    head = el(
        "head",
        el("meta", charset="utf-8"),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="color-scheme", content="light dark"),
        el("meta", http_equiv="Content-Security-Policy", content=policy),
        el("title", title),
        el("style", style),
    )
    return f"<!DOCTYPE html>\n{el('html', head, el('body', *body), lang='en')}\n"


def overview(side: Side) -> str:
    """Say in one line what a directory contains."""
    runs, spent = side.runs, spent_on(side.runs)
    # Requirements that share a search are one run.
    failed = {run.directory for run in runs if run.status == "failed"}
    open_ = {run.directory for run in runs if not run.finished} - failed
    violated = sum(section.status == "violated" for section in side.sections)
    parts = [
        f"{side.title}: {violated} of {counted(len(side.sections), 'requirement')} violated",
        counted(len({run.directory for run in runs}), "run"),
        *([f"{len(failed)} failed"] if failed else []),
        *([f"{len(open_)} not finished"] if open_ else []),
        spent.simulations_text,
        *([f"language model: {llm_use(spent)}"] if spent.questions else []),
    ]
    if runs:
        started = min(run.manifest.started for run in runs)  # such as 2026-03-01T10:20:30+00:00
        parts.append(f"started {started[:16].replace('T', ' ')} UTC")
    return ", ".join(parts) + "."


def drawn(make: "Callable[[], Figure]", description: str) -> Html:
    """Draw a figure into the page; if it cannot be drawn, say so."""
    try:
        content = svg(make())
    except Exception as error:  # whatever a drawing library thinks of values and names that others chose
        return el("p", f"Not drawn: {error}", class_="note")
    return el("figure", picture(content, "svg+xml", description))


def facts_html(facts: Iterable[Fact]) -> Html:
    """Show names and what is said under them."""
    return el("dl", *(join(el("dt", name), el("dd", text)) for name, text in facts))


def card_html(section: Section, *, title: str = "", more: Sequence[str]) -> Html:
    """Show the verdict on a requirement: what was found, or what was tried, and below it what is more."""
    status = section.status
    found = _found(section.shown[0]) if section.shown else []
    if status != "violated":
        what = wording.tried(section)
        found.append(join(el("h3", "What was tried"), facts_html(what)) if what else "")
        found.append(_lines("What this does not show", wording.unshown_lines(section)))
    return el(
        "article",
        el("h2", title or section.heading, " ", el("span", status, class_="badge")),
        el("p", section.sentence, class_="sentence"),
        el("p", wording.result_text(section), class_="result"),
        *found,
        _lines("Incomplete runs and unconfirmed violations", wording.trouble_lines(section)),
        *more,
        class_=f"card {status.replace(' ', '-')}",
    )


def _anchor(name: str) -> str:
    return f"requirement-{file_name(name)}"


def _verdicts(sides: Sequence[Side], name: str, sections: Sequence[Section | None], most: int) -> Html:
    """The cards of one requirement, side by side if several directories are compared."""
    cards = []
    for side, section in zip(sides, sections, strict=True):
        title = f"{section.heading if section else name}: {side.title}" if len(sections) > 1 else ""
        if section is None:
            cards.append(
                el("article", el("h2", title), el("p", "Not searched here.", class_="note"), class_="card")
            )
        else:
            cards.append(card_html(section, title=title, more=[_details(section, most)]))
    return el("section", *cards, id=_anchor(name), class_="sides")


def _found(shown: Shown) -> list[str]:
    """What violates, or came nearest: limit and value, picture, inputs, why, and whether it is confirmed."""
    named = f"The {shown.what}"
    if shown.panels:
        names = ", ".join(panel.title for panel in shown.panels)
        seen = drawn(lambda: plot_panels(shown.panels, shown.verdict), f"over time: {names}")
    else:
        lost = "its file is damaged or missing" if shown.is_lost else "its trajectory was not kept"
        seen = el("p", f"{named} is not shown: {lost}.", class_="note")
    inputs = wording.input_table(shown)
    listed = table(inputs.header, inputs.rows, label=inputs.title, numbers=True) if inputs.rows else ""
    if len(inputs.rows) > _MOST_ROWS:
        listed = el("details", el("summary", f"Table of {counted(len(inputs.rows), 'row')}"), listed)
    parameters = wording.parameter_facts(shown)
    return [
        el("div", facts_html(wording.limit_facts(shown)), class_="limits") if shown.verdict else "",
        el("h3", named),
        seen,
        el("h3", "Inputs to enter in a simulator"),
        listed,
        facts_html(parameters) if parameters else "",
        join(el("h3", "Explanation"), el("p", shown.explanation)) if shown.explanation else "",
        facts_html([("confirmed", shown.confirmed)]) if shown.confirmed else "",
        *(el("p", f"{what}: ", el("code", how), class_="note") for what, how in wording.advice(shown)),
    ]


def _lines(title: str, lines: Sequence[str]) -> str:
    return join(el("h3", title), el("ul", *(el("li", line) for line in lines))) if lines else ""


def _details(section: Section, most: int) -> Html:
    """What a verdict rests on: formula, runs, robustness over simulations, other finds, questions."""
    runs, first = section.runs, section.shown[:1]
    held = held_text(runs[0].manifest.not_searched)
    histories = [
        drawn(partial(plot_history, members), f"Robustness over simulations, {method.label}")
        for (_, method), members in group(runs).items()
    ]
    if len(runs) > 1:
        histories.append(drawn(lambda: plot_rates(runs), "Share of falsified runs over simulations"))
    others = []
    for other in section.shown[1:]:
        heading = f"{run_name(other.run)}: after {other.run.spent.simulations_text}"
        others.append(el("details", el("summary", heading), *_found(other), _shown_details(other)))
    return el(
        "details",
        el("summary", f"Formula, {counted(len(runs), 'run')}, engines and seeds"),
        el("p", el("code", section.formula), class_="formula"),
        *map(_shown_details, first),
        facts_html([("not searched", held)]) if held else "",
        _runs(runs),
        *histories,
        *others,
        _questions(section, most),
        class_="more",
    )


def _runs(runs: Sequence[Run]) -> Html:
    rows = []
    for run in runs:
        robustness = signed(run.verdict.robustness) if run.verdict else "–"
        simulation = run.spent.simulation_seconds / max(1, run.simulations)
        proposal = run.spent.engine_seconds / max(1, run.simulations)
        asked = ", questions included" if run.spent.questions else ""
        seconds = f"simulation {readable(simulation, 3)}, proposal {readable(proposal, 3)}{asked}"
        seconds = seconds if run.simulations else "–"
        ended = wording.replay_command(run) if run.falsified else run.reason
        rows.append((run_name(run), run.status, run.spent.simulations_text, robustness, seconds, ended))
    header = ("run", "ended", "simulations", "robustness", "seconds on average", "replay, or why it ended")
    return table(header, rows, label="Runs")


def _shown_details(shown: Shown) -> Html:
    """What engineers of searches ask about a simulation, and how it is repeated."""
    rationale = shown.candidate.rationale
    facts = [*wording.margin_beside(shown), *([("rationale", rationale)] if rationale else [])]
    facts += [(name, el("code", command)) for name, command in wording.commands(shown)]
    return facts_html(facts)


def _questions(section: Section, most: int) -> str:
    """What the runs of a requirement asked a language model."""
    asked = [run for run in section.found if run.spent.questions]
    if not asked:
        return ""
    parts = [
        join(el("h4", run_name(run)), exchanges_html(run.directory, run.requirement, most=most))
        for run in asked[:_MOST_TALKS]
    ]
    rest = [f"{run_name(run)}: falsifier report {shell_word(run.directory)}." for run in asked[_MOST_TALKS:]]
    note = el("p", " ".join(["Not shown here:", *rest]), class_="note") if rest else ""
    return join(el("h3", "What was asked, and what came of it"), *parts, note)


def _statistics(side: Side) -> str:
    if side.table is None:
        return ""
    main = side.table.only(*(name for name in side.table.header if name not in _FOLDED))
    folded = side.table.only(*(name for name in side.table.header if name in (*_KEYS, *_FOLDED)))
    return el(
        "section",
        el("h2", f"Statistics: {side.title}"),
        _table(main),
        el("details", el("summary", "Spread, times, tokens and cost"), _table(folded)),
        *(el("p", note, class_="note") for note in side.table.notes),
        class_="statistics",
    )


def _table(shown: Table) -> Html:
    rows = [(el("a", first, href=f"#{_anchor(first)}"), *rest) for first, *rest in shown.rows]
    return table(shown.header, rows, label=shown.title, numbers=True)


def _environment(side: Side) -> Html:
    facts: dict[str, dict[str, None]] = {}  # runs of several machines may differ
    for manifest in (run.manifest for run in side.runs):
        for name, value in {
            "falsifier": manifest.falsifier,
            "Python": manifest.python,
            "platform": manifest.platform,
            **manifest.packages,
            **{path: f"SHA-256 {digest}" for path, digest in manifest.hashes.items()},
        }.items():
            facts.setdefault(name, {})[value] = None
    told = ((name, "; ".join(values)) for name, values in facts.items())
    return el("details", el("summary", f"Versions and files: {side.title}"), facts_html(told))
