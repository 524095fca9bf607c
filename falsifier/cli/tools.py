"""``falsifier tools``: building FMUs, repairing records, validating results, printing schemas."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from falsifier.campaigns.archcomp import PROTOCOL_SIMULATIONS, Revalidated, read_rows, validate as check_rows
from falsifier.campaigns.directory import (
    CampaignRecord,
    campaign_lock,
    is_campaign,
    is_worked_on,
    read_campaign,
    run_directory,
)
from falsifier.cli.command import command
from falsifier.cli.files import check_out, in_existing_folder
from falsifier.cli.inspect import one_fmu
from falsifier.cli.options import PATH, budget_option, directory_argument, json_option, out_option
from falsifier.cli.output import as_shown, conclude, say
from falsifier.core.literals import one_line
from falsifier.core.words import counted
from falsifier.counterexamples.store import load_counterexample
from falsifier.errors import JournalError, SpecError
from falsifier.fmu.build import compile_sources
from falsifier.problem.spec import Spec
from falsifier.record.files import set_aside
from falsifier.record.journal import simulated
from falsifier.record.manifest import MANIFEST, Manifest
from falsifier.record.records import RECORDS
from falsifier.record.repair import repair as repair_run
from falsifier.stl.margins import signed
from falsifier.views.terminal import warn

if TYPE_CHECKING:
    from pydantic import BaseModel


@command()
@directory_argument
def repair(*, directory: Path) -> None:
    """Repair the run or campaign in DIRECTORY after its files were damaged.

    Says what is wrong, keeps a copy of every file that it changes, and removes damaged parts; falsifier
    resume repeats them. A run of a campaign that cannot be repaired is set aside, and the campaign repeats
    it. One that is in use is left as it is.

    Exit codes: 0 repaired, or nothing is damaged, 2 wrong usage, or runs that are in use were left.
    """
    findings, busy = _repair_campaign(directory) if is_campaign(directory) else (_repair_run(directory), [])
    for finding in findings:
        say(finding)
    for place in busy:
        warn(f"{place}: left, as another process is writing to this run; once it has ended, repair again")
    held = None if is_campaign(directory) else simulated(directory)
    intact = "the journal contains no simulation" if held == 0 else "nothing is damaged"
    intact += f"; {counted(held, 'simulation')} recorded" if held else " in the other runs" if busy else ""
    conclude("repaired" if findings else f"{directory}: {intact}", JournalError.exit_code if busy else 0)


def _repair_campaign(directory: Path) -> tuple[list[str], list[Path]]:
    """Return what was found, and the runs that are in use, which are left."""
    findings, busy = list[str](), list[Path]()
    with campaign_lock(directory):
        for name in read_campaign(directory).request.named():
            place = run_directory(directory, name)
            if not place.is_dir() or not any(place.iterdir()):
                continue
            try:
                findings += _repair_run(place)
            except JournalError as error:
                if is_worked_on(place):  # by a process that continues this run alone
                    busy.append(place)
                    continue
                why = f"{place / MANIFEST}: {error.__cause__}" if error.__cause__ else error
                findings.append(f"{why}; kept as {set_aside(place).name}, the campaign repeats it")
    return findings, busy


def _repair_run(directory: Path) -> list[str]:
    findings = repair_run(directory)
    for kind, maker in (("counterexample", "replay"), ("shrunk", "explain --shrink")):
        for path in sorted(directory.glob(f"{kind}*.json")):
            try:
                load_counterexample(path)
            except SpecError as error:
                wrong = str(error).partition("; ")[0]
                findings.append(f"{wrong}; kept as {set_aside(path).name}, falsifier {maker} writes it again")
    return findings


@command()
@click.argument("fmu", type=PATH)
@out_option("FMU to write; default: NAME-PLATFORM.fmu in the same directory.")
def build(*, fmu: Path, out: Path | None) -> None:
    """Compile an FMU's C sources for this platform and write a copy of the FMU with the binary."""
    source = one_fmu(fmu)
    target = in_existing_folder(out or fmu.with_name(f"{fmu.stem}-{sys.platform}.fmu"))
    check_out(target, begins=b"PK", kept=source)
    say(f"{compile_sources(source, target)} written")


@command()
@click.argument(
    "what", type=click.Choice(["spec", "manifest", "journal", "campaign"]), default="spec", required=False
)
def schema(*, what: str) -> None:
    """Print the JSON Schema of spec files, for editors, or of a file in run directories.

    The schema of a journal describes a single line.
    """
    models: dict[str, type[BaseModel]] = {"spec": Spec, "manifest": Manifest, "campaign": CampaignRecord}
    found = RECORDS.json_schema() if what == "journal" else models[what].model_json_schema()
    say(json.dumps(found, indent=2))


@command()
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@budget_option(PROTOCOL_SIMULATIONS, note=" per run; claims that used more are rejected")
@json_option
def validate(*, file: Path, budget: int, as_json: bool) -> None:
    """Re-simulate the counterexamples in FILE and report which of them are reproduced.

    FILE is a CSV file in the validation format of the ARCH-COMP falsification category, written by any tool.

    Exit codes: 0 all accepted, 1 some rejected, 2 wrong usage or file.
    """
    findings = check_rows(read_rows(file), budget=budget)
    accepted = f"{sum(f.accepted for f in findings)} of {counted(len(findings), 'counterexample')} accepted"
    text = "\n".join([*map(_finding_line, findings), accepted])
    content = [
        {
            "row": f.row.number,
            "requirement": f.row.requirement,
            "accepted": f.accepted,
            "robustness": f.robustness,
            "claimed": f.row.robustness,
            "reason": f.reason,
        }
        for f in findings
    ]
    conclude(as_shown(text, content, as_json=as_json), 0 if all(f.accepted for f in findings) else 1)


def _finding_line(f: Revalidated) -> str:
    rejected = "rejected: " if f.robustness is None else ""  # without a simulation the claim is invalid
    robustness = "" if f.robustness is None else f", robustness {signed(f.robustness)}"
    return one_line(f"row {f.row.number}, {f.row.requirement}: {rejected}{f.reason}{robustness}")
