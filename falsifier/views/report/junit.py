"""The report as JUnit XML: one test case per run; a falsified requirement is a failure."""

from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

from falsifier.campaigns.analysis import Run, load
from falsifier.core.literals import plain
from falsifier.core.words import counted
from falsifier.stl.margins import signed
from falsifier.views.report.content import searches
from falsifier.views.report.wording import replay_command, run_command, unshown
from falsifier.views.text import broken_lines


def junit_report(directory: Path) -> str:
    """Report on a run or a campaign, one test suite per method.

    Raises:
        JournalError: if the directory is neither, or is damaged.
    """
    runs = sorted(load(directory), key=lambda run: run.method)
    root = ElementTree.Element("testsuites", name="falsifier")
    for method, members in groupby(runs, key=lambda run: run.method):
        root.append(_suite(method.label, list(members)))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _suite(label: str, runs: list[Run]) -> ElementTree.Element:
    suite = ElementTree.Element(
        "testsuite",
        name=plain(label),
        time=f"{sum(r.spent.seconds for r in searches(runs)):.3f}",
        tests=str(len(runs)),
        failures=str(sum(run.falsified for run in runs)),
        errors=str(sum(run.status == "failed" for run in runs)),
        skipped=str(sum(not run.finished and run.status != "failed" for run in runs)),
    )
    suite.extend(_case(label, run) for run in runs)
    return suite


def _case(label: str, run: Run) -> ElementTree.Element:
    case = ElementTree.Element(
        "testcase",
        classname=plain(f"{label}.{run.requirement}"),
        name=f"seed {run.seed}",
        time=f"{run.spent.seconds:.3f}",
    )
    if run.falsified and run.verdict is not None:
        count = counted(run.simulations, "simulation")
        broken = f"{run.verdict.breach.main.what}; " if run.verdict.breach else ""
        message = f"{broken}robustness {signed(run.verdict.robustness)} after {count}"
        failure = ElementTree.SubElement(case, "failure", message=plain(message), type="falsified")
        lines = (
            run.manifest.requirement.formula,
            *broken_lines(run.verdict),
            f"decided at t = {run.verdict.critical_time:.6g} s: {run.verdict.predicate}",
            run.reason,
            replay_command(run),
            run_command(run.manifest.request, shared=run.shared),
        )
        failure.text = plain("\n".join(lines))
    elif run.status == "failed":
        ElementTree.SubElement(case, "error", message=plain(run.reason), type="failed")
    elif not run.finished:
        ElementTree.SubElement(case, "skipped", message=run.status)
    if told := unshown(run):
        note = ElementTree.SubElement(case, "system-out")
        note.text = plain("\n".join(f"what this does not show: {line}" for line in told))
    return case
