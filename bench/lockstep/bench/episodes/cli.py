"""`python -m lockstep.bench.episodes`: episodes of the SO-101 by two people and a policy, and their dataset's pixels.

Needs the arm's model: lockstep robot fetch so101.
"""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from lockstep.bench.episodes.faults.fault_alone import run_fault
from lockstep.bench.episodes.faults.fault_run import ALONE, FAULTS, FaultName
from lockstep.bench.episodes.faults.faulted_day import record_faulted_day
from lockstep.bench.episodes.run import Choices, record_episodes
from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.harness.processes import ProcessFailed
from lockstep.client.errors import ConsoleError
from lockstep.emulator.errors import ProfileError

__all__ = ["app"]

EXIT_FAILED = 3

LOOK_SECONDS = 1.5

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def command(
    network: Annotated[str, typer.Option(help="A profile of lockstep network, such as hong-kong; unset: none.")] = "",
    times: Annotated[int, typer.Option(min=1, max=1000, help="How many episodes.")] = 30,
    discard: Annotated[int, typer.Option(min=0, help="How many of them are discarded.")] = 6,
    redo: Annotated[int, typer.Option(min=0, help="How many of them are done again.")] = 4,
    fault: Annotated[
        list[str] | None,
        typer.Option(help=f"Try this fault instead, by itself; all, or one of {', '.join(FAULTS)}. May repeat."),
    ] = None,
    among: Annotated[
        bool,
        typer.Option(
            "--among-episodes", help="The faults strike among the planned episodes; all of them unless named."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the network, and of what becomes of which episode.")] = 1,
    pictures: Annotated[bool, typer.Option(help="The drivers receive the pictures of both cameras.")] = True,
    keep: Annotated[Path | None, typer.Option(help="Keep the recordings and the dataset in this folder.")] = None,
    json_to: Annotated[str, typer.Option("--json", help="Write the figures there; - is standard output.")] = "",
) -> None:
    """Record episodes, export them, and look at each picture of the dataset; ends with 1 when something is wrong."""
    faults = _faults(fault or (["all"] if among else []))
    if among and (alone := [each for each in faults if each in ALONE]):
        if fault and "all" not in fault:
            raise typer.BadParameter(f"{', '.join(alone)} is tried by itself only")
        faults = [each for each in faults if each not in ALONE]
    choices = Choices(network, times, discard, redo, seed, pictures, keep)
    if discard + redo > times:
        raise typer.BadParameter("more episodes are discarded and redone than there are")
    busy = uvloop.run(busy_percent(LOOK_SECONDS))
    try:
        if among:
            figures: dict[str, Any] = uvloop.run(record_faulted_day(choices, faults, _say))
        elif faults:
            tried = [uvloop.run(run_fault(each, _say)) for each in faults]
            figures = {"faults": tried, "ok": all(each["ok"] for each in tried)}
        else:
            figures = uvloop.run(record_episodes(choices, _say))
    except ProfileError as error:
        raise typer.BadParameter(str(error)) from error
    except (ProcessFailed, ConsoleError, TimeoutError) as error:
        _say(str(error) or "an episode took too long")
        raise typer.Exit(EXIT_FAILED) from error
    if "faults" in figures:
        _say(_faults_table(figures))
    if "runs" in figures:
        _say(_table(figures))
    text = json.dumps(kept_run(busy, [figures]), indent=1) + "\n"
    if json_to == "-":
        sys.stdout.write(text)
    elif json_to:
        Path(json_to).write_text(text)
    raise typer.Exit(0 if figures["ok"] else 1)


def _faults(names: list[str]) -> list[FaultName]:
    unknown = set(names) - {"all", *FAULTS}
    if unknown:
        raise typer.BadParameter(f"no fault {', '.join(sorted(unknown))}; there are {', '.join(FAULTS)}")
    return [each for each in FAULTS if each in names or "all" in names]


def _table(figures: dict[str, Any]) -> str:
    lines = [
        "",
        "| no. | drivers | became | s | offers | corrections | rows | left out | problems |",
        "|--:|---|---|--:|--:|--:|--:|--:|---|",
    ]
    for each in figures["runs"]:
        lines.append(
            f"| {each['number']} | {', '.join(each['drivers'])} | {each['fate']} | {each['seconds']} | "
            f"{each['offers']} | {each['corrections']} | {each['rows']} | {each['left_out']} | "
            f"{'; '.join(each['problems'])} |"
        )
    dataset = figures["dataset"]
    lines.append(
        f"{figures['network'] or 'no network'}: {figures['episodes']} episodes, {figures['discarded']} discarded, "
        f"{figures['redone']} redone, {figures['kept']} kept, a policy drove in "
        f"{figures['with_policy']} and was corrected {figures['corrections']} times; "
        f"dataset: {len(dataset.get('rows', []))} episodes, "
        f"{sum(dataset.get('rows', []))} rows ({dataset.get('policy', 0)} of the policy, "
        f"{dataset.get('interventions', 0)} interventions), {dataset.get('pictures', 0)} pictures, "
        f"{dataset.get('unreadable', 0)} unreadable, {dataset.get('outside', 0)} outside of the tolerance of "
        f"{dataset.get('tolerance', 0)} events, pictures by gap {dataset.get('gaps', {})}"
    )
    lines += [f"WRONG: {each}" for each in dataset["wrong"]]
    if (appended := figures.get("appended")) is not None:
        lines.append(
            f"appended: {len(appended.get('rows', []))} episodes, {appended['while_driving']} of them while people "
            f"drove, pictures by gap {appended.get('gaps', {})}"
        )
        lines += [f"WRONG, appended: {each}" for each in appended["wrong"]]
    return "\n".join(lines)


def _faults_table(figures: dict[str, Any]) -> str:
    lines = ["", "| fault | the console said | |", "|---|---|---|"]
    for each in figures["faults"]:
        right = "right" if each["ok"] else f"WRONG: {'; '.join(each['wrong'])}"
        lines.append(f"| {each['fault']} | {'; '.join(each['said'])} | {right} |")
    return "\n".join(lines)


def _say(text: str) -> None:
    typer.echo(f"episodes: {text}", err=True)
