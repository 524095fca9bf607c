"""The report as one self-contained HTML page.

Its only scripts are the plotting library's and the one that calls it; its policy forbids all others and
the network.
"""

from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from falsifier.campaigns.analysis import Run, Table
from falsifier.campaigns.progress import total
from falsifier.core.files import file_name
from falsifier.core.words import choices, counted
from falsifier.problem.problem import held_text
from falsifier.stl.margins import signed
from falsifier.views.exchanges import exchanges_html
from falsifier.views.html import Html, el, join
from falsifier.views.report.content import (
    Content,
    Section,
    Shown,
    gather,
    level_facts,
    outcome,
    replay_command,
    run_command,
    searches,
    unshown_lines,
)
from falsifier.views.report.figures import history_figure, rate_figure, simulation_figures
from falsifier.views.report.plots import columns, scripts

_HINT = (
    "Plots: drag a rectangle to zoom, point at a curve to read its values; the buttons beside a plot "
    "move it, zoom with the wheel, reset and save it. The plots of one simulation are zoomed together."
)
# Maximum number of runs per requirement, and of questions on the whole page, that are shown: a prompt has
# some 20 kB, and a page that is sent around should stay below a few MB.
_MOST_TALKS = 3
_MOST_QUESTIONS = 30

# Columns of the table that name a row, and those that are folded away so that the others fit on a screen.
_KEYS = ("requirement", "method")
_FOLDED = ("median S", "std S", "sim. s", "total s", "tokens", "cost $")


def html_report(directory: Path) -> str:
    """Report on a run or a campaign.

    Raises:
        JournalError: if the directory is neither, or is damaged.
    """
    return page(gather(directory))


def page(content: Content) -> str:
    """Lay out a report."""
    run = scripts() if content.sections else []
    fineness = columns(sum(len(shown.panels) for section in content.sections for shown in section.shown))
    asking = sum(min(_MOST_TALKS, sum(s.run.spent.calls > 0 for s in c.shown)) for c in content.sections)
    most = max(1, _MOST_QUESTIONS // max(1, asking))
    style = Html(files("falsifier.views.report").joinpath("style.css").read_text(encoding="utf-8"))
    title = f"Falsification report: {content.title}"
    head = el(
        "head",
        el("meta", charset="utf-8"),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="color-scheme", content="light dark"),
        el("meta", http_equiv="Content-Security-Policy", content=_policy(run)),
        el("title", title),
        el("style", style),
    )
    body = el(
        "body",
        el("a", "Skip to the results", href="#requirements", class_="skip"),
        el("header", el("h1", title), el("p", _overview(content))),
        _navigation(content),
        el(
            "main",
            _requirements(content),
            _summary(content),
            *(_section(section, fineness, most) for section in content.sections),
            _environment(content),
        ),
        *(el("script", Html(text)) for text in run),
    )
    return f"<!DOCTYPE html>\n{el('html', head, body, lang='en')}\n"


def _policy(scripts: list[str]) -> str:
    """Content Security Policy: these scripts by their hash, styles and pictures of the page, nothing else."""
    hashes = [b64encode(sha256(text.encode()).digest()).decode() for text in scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes) or "'none'"
    return f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:"


def _overview(content: Content) -> str:
    runs = content.runs
    falsified = sum(run.falsified for run in runs)
    failed = sum(run.status == "failed" for run in runs)
    open_ = sum(not run.finished for run in runs) - failed
    started = min((run.manifest.started for run in runs), default="")
    parts = [
        counted(len(content.sections), "requirement"),
        f"{counted(len(runs), 'run')}, {falsified} falsified",
        *([f"{failed} failed"] if failed else []),
        *([f"{open_} not finished"] if open_ else []),
        total(run.spent for run in searches(runs)).simulations_text,
        f"started {started}",
    ]
    return ", ".join(parts) + "."


def _navigation(content: Content) -> Html:
    names = {"requirements": "Requirements", "summary": "Numbers"}
    names |= {_anchor(section): section.name for section in content.sections} | {"environment": "Environment"}
    links = [el("li", el("a", name, href=f"#{anchor}")) for anchor, name in names.items()]
    return el("nav", el("ul", *links), aria_label="Sections")


def _requirements(content: Content) -> Html:
    """One line per requirement: what came of it, and what it means."""
    rows = tuple((s.name, outcome(s), s.description or s.formula) for s in content.sections)
    table = Table("Requirements", ("requirement", "result", "meaning"), rows)
    return el(
        "section", el("h2", "Requirements"), _table(table, _anchors(content), "words"), id="requirements"
    )


def _summary(content: Content) -> Html:
    anchors, table = _anchors(content), content.table
    main = table.only(*(name for name in table.header if name not in _FOLDED))
    folded = table.only(*(name for name in table.header if name in (*_KEYS, *_FOLDED)))
    return el(
        "section",
        el("h2", "Numbers"),
        _table(main, anchors),
        el("details", el("summary", "Spread, times, tokens and cost"), _table(folded, anchors)),
        *(el("p", note, class_="note") for note in content.table.notes),
        el("p", _HINT, class_="note hint"),
        id="summary",
    )


def _anchors(content: Content) -> dict[str, str]:
    return {section.name: _anchor(section) for section in content.sections}


def _table(table: Table, anchors: dict[str, str], kind: str = "") -> Html:
    header = el("tr", *(el("th", name, scope="col") for name in table.header))
    rows = []
    for row in table.rows:
        first = el("a", row[0], href=f"#{anchors[row[0]]}") if row[0] in anchors else row[0]
        rows.append(el("tr", el("th", first, scope="row"), *(el("td", cell) for cell in row[1:])))
    body = el("table", el("thead", header), el("tbody", *rows), class_=kind or None)
    return _scrolling(body, table.title)


def _scrolling(content: Html, label: str) -> Html:
    """Wide content in its own scrolling region, reachable by keyboard."""
    return el("div", content, class_="scroll", tabindex="0", role="region", aria_label=label)


def _questions(section: Section, most: int) -> Html:
    """What the runs of a requirement asked a language model."""
    asked = [shown.run for shown in section.shown if shown.run.spent.calls]
    if not asked:
        return Html("")
    parts = [
        join(
            el("h4", f"{run.method.label}, seed {run.seed}"),
            exchanges_html(run.directory, run.requirement, most=most),
        )
        for run in asked[:_MOST_TALKS]
    ]
    rest = "".join(
        f" {run.method.label}, seed {run.seed}: falsifier report {run.directory}."
        for run in asked[_MOST_TALKS:]
    )
    note = el("p", f"Not shown here:{rest}", class_="note") if rest else Html("")
    return join(el("h3", "What was asked, and what came of it"), *parts, note)


def _section(section: Section, fineness: int, most: int) -> Html:
    drawn = [history_figure(runs, label) for label, runs in section.by_method.items()]
    if len(section.runs) > 1:
        drawn.append(rate_figure(section.by_method))
    found = any(shown.run.falsified for shown in section.shown)
    title = "Counterexamples" if found else "Closest to a violation"
    return el(
        "section",
        el("h2", section.heading),
        el("p", section.description) if section.description else Html(""),
        el("p", el("code", section.formula), class_="formula")
        if section.heading == section.name
        else Html(""),
        *drawn,
        el("h3", title),
        *(_shown(shown, fineness, opened=i == 0) for i, shown in enumerate(section.shown)),
        _questions(section, most),
        _findings(section),
        _troubles(section),
        id=_anchor(section),
    )


def _shown(shown: Shown, fineness: int, *, opened: bool) -> Html:
    run, verdict = shown.run, shown.run.verdict
    robustness = f"robustness {signed(verdict.robustness)}" if verdict else "no verdict"
    heading = f"{run.method.label}, seed {run.seed}: {run.spent.simulations_text}, {robustness}"
    facts: list[tuple[str, str]] = [("confirmed" if run.falsified else run.status, run.reason)]
    if verdict is not None:
        values = ", ".join(f"{name} = {value:.6g}" for name, value in verdict.values.items())
        facts += [("what broke", verdict.breach.text)] if verdict.breach else []
        facts += [
            ("critical time", f"{verdict.critical_time:.6g} s, decided by {verdict.predicate}"),
            ("values then", values),
        ]
    facts += [(f"{c.role} {c.label}", c.text) for c in choices(shown.candidate)]
    if run.simulations:
        facts.append(("time per iteration", _time(run)))
    if shown.is_lost:
        facts.append(("trajectory", "not shown: its file is damaged or missing"))
    facts += level_facts(run)
    facts += [("not searched", held_text(run.manifest.not_searched))] if run.manifest.not_searched else []
    commands = [("repeat the run", run_command(run.manifest.request, shared=run.shared))]
    if run.falsified:
        commands.insert(0, ("replay the counterexample", replay_command(run)))
    rationale = shown.candidate.rationale
    return el(
        "details",
        el("summary", heading),
        simulation_figures(shown.panels, verdict.moment if verdict else None, fineness),
        _facts(facts),
        el("blockquote", rationale, title="the engine's rationale") if rationale else Html(""),
        el("dl", *(join(el("dt", k), el("dd", el("code", v))) for k, v in commands)),
        open="" if opened else None,
    )


def _time(run: Run) -> str:
    """Mean times of a run."""
    spent, count = run.spent, run.simulations
    return (
        f"simulation {spent.simulation_seconds / count:.3g} s, proposal {spent.engine_seconds / count:.3g} s"
        f"{', questions included' if spent.calls else ''}, on average"
    )


def _facts(facts: list[tuple[str, str]]) -> Html:
    return el("dl", *(join(el("dt", name), el("dd", text)) for name, text in facts))


def _findings(section: Section) -> Html:
    """What the searches could not show."""
    items = [el("li", line) for line in unshown_lines(section)]
    return join(el("h3", "What this does not show"), el("ul", *items)) if items else Html("")


def _troubles(section: Section) -> Html:
    """Runs that failed or were interrupted, and violations that were not confirmed."""
    items = [
        el("li", f"{run.method.label}, seed {run.seed}: {run.status}: {run.reason}")
        for run in section.runs
        if run.status in ("failed", "interrupted")
    ]
    items += [
        el("li", f"{run.method.label}, seed {run.seed}, simulation {index + 1}: {outcome}")
        for run in section.runs
        for index, outcome in run.unconfirmed.items()
    ]
    title = "Incomplete runs and unconfirmed violations"
    return join(el("h3", title), el("ul", *items)) if items else Html("")


def _environment(content: Content) -> Html:
    facts: dict[str, str] = {}
    for manifest in (run.manifest for run in content.runs):
        facts |= {
            "falsifier": manifest.falsifier,
            "Python": manifest.python,
            "platform": manifest.platform,
            **manifest.packages,
            **{path: f"SHA-256 {digest}" for path, digest in manifest.hashes.items()},
        }
    return el("section", el("h2", "Environment"), _facts(list(facts.items())), id="environment")


def _anchor(section: Section) -> str:
    return f"requirement-{file_name(section.name)}"
