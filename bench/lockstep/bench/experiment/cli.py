"""`lockstep experiment`."""

import json
import sys
from collections.abc import Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
import uvloop

from lockstep.bench.experiment.choices import PROFILES, Choices, Mode, media_of, round_trip_of
from lockstep.bench.experiment.endurance.endurance_run import EnduranceClient, run_endurance
from lockstep.bench.experiment.endurance.growth import run_growth
from lockstep.bench.experiment.judge.findings import Cell, Findings
from lockstep.bench.experiment.judge.outage import OUTAGE_PROFILE, run_outages
from lockstep.bench.experiment.judge.results import result_of
from lockstep.bench.experiment.judge.table import render_table
from lockstep.bench.experiment.matrix import GROWTH_SECONDS, OUTAGE_SECONDS, matrix_of, thesis_matrix_of
from lockstep.bench.experiment.run import run_experiment
from lockstep.bench.figures.machine import machine_facts
from lockstep.bench.harness.processes import ProcessFailed
from lockstep.client.errors import ConsoleError
from lockstep.emulator.errors import ProfileError
from lockstep.emulator.impairment.profile import Profile, load_profile
from lockstep.robot_bridge.robots.registry import robot_names

__all__ = ["experiment_command"]

EXIT_BROKEN = 1  # a verdict is false
EXIT_USAGE = 2
EXIT_FAILED = 3  # a run failed
GROWTH_PROFILE = "hong-kong"
OWN_ROBOT = "planar"
RUN_SECONDS = 25.0
ENDURANCE_SECONDS = 600.0
ENDURANCE_NETWORK = "satellite"
ENDURANCE_WORDS = ("connections", "reconnections", "seat_losses", "pictures", "violations")
OWN_TOLERANCE = -1  # the tolerance of the profile

Found = TypeVar("Found")


def experiment_command(
    profile: Annotated[
        str,
        typer.Argument(
            help=f"A network: {', '.join(PROFILES)}, or the file of one. Or growth: how large the gap gets without a "
            "gate. Or outage: the network is cut in mid-drive. Or all of these. Or thesis: its three experiments, "
            "without and with, each with a robot of its kind. Or endurance: whether connections last."
        ),
    ],
    mode: Annotated[
        Mode, typer.Option(help="off: no gate; age: a gate by age; feedback: the thesis' rule; media: media pacing.")
    ] = "feedback",
    seconds: Annotated[
        float | None,
        typer.Option(
            min=1,
            help="How long; unless given 25 s a run, 6 s a rate for growth, 10 s of outage, 600 s of endurance.",
        ),
    ] = None,
    tolerance: Annotated[
        int | None, typer.Option(min=0, max=1000, help="Largest gap, in events; unless given, the profile's own.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the network and the operator.")] = 1,
    robot: Annotated[
        str | None,
        typer.Option(help=f"{', '.join(robot_names())}; unless given planar, and for thesis one of the thesis' kind."),
    ] = None,
    browser: Annotated[bool, typer.Option("--browser", help="The operator is a page in Chromium.")] = False,
    network: Annotated[
        str | None,
        typer.Option(
            help="Of endurance and outage: a network, or the file of one; unless given satellite, and for outage "
            "one of 40 ms round trip."
        ),
    ] = None,
    client: Annotated[
        EnduranceClient | None, typer.Option(help="Of endurance; unless given, as --browser says.")
    ] = None,
    watchers: Annotated[
        bool | None,
        typer.Option(help="Clients in the other gate modes beside the operator; unless given, without a browser."),
    ] = None,
    quality: Annotated[
        bool | None, typer.Option(help="The quality controller; unless given, for all but the thesis' networks.")
    ] = None,
    json_to: Annotated[str, typer.Option("--json", help="Write the figures there; - is standard output.")] = "",
    report: Annotated[Path | None, typer.Option(help="Write a page with the figures into this folder.")] = None,
) -> None:
    """Drive a robot over an emulated network and report the rendered media, and how far they were behind the robot."""
    choices = Choices(
        profile=profile,
        mode=mode,
        seconds=seconds or RUN_SECONDS,
        tolerance=OWN_TOLERANCE if tolerance is None else tolerance,
        seed=seed,
        robot=robot or OWN_ROBOT,
        browser=browser,
        adapts=quality,
        watchers=not browser if watchers is None else watchers,
    )
    session = _Session(report)
    try:
        if profile == "endurance":
            lasting = replace(choices, profile=network or ENDURANCE_NETWORK, seconds=seconds or ENDURANCE_SECONDS)
            session.endure(lasting, client or ("chromium" if browser else "headless"))
        else:
            _work(session, choices, seconds, robot, network)
    except KeyboardInterrupt:
        _say("interrupted: the results so far")
    session.publish(json_to)


def _work(session: "_Session", choices: Choices, seconds: float | None, robot: str | None, network: str | None) -> None:
    if choices.profile == "outage":
        session.outage(replace(choices, seconds=seconds or OUTAGE_SECONDS), network)
    elif choices.profile == "growth":
        session.grow(replace(choices, seconds=seconds or GROWTH_SECONDS))
    elif choices.profile == "all":
        session.grow(replace(choices, seconds=GROWTH_SECONDS))
        for each in matrix_of(choices):
            session.drive(each)
        session.outage(replace(choices, seconds=OUTAGE_SECONDS), network)
    elif choices.profile == "thesis":
        for each in thesis_matrix_of(choices, robot):
            session.drive(each)
    else:
        session.drive(choices)


class _Session:
    """Runs one thing after the other; one that fails does not keep the others from being run.

    The findings are written after each, so that an end before the last loses nothing but the page.
    """

    def __init__(self, folder: Path | None) -> None:
        self._findings = Findings(machine=machine_facts())
        self._folder = folder

    def drive(self, choices: Choices) -> None:
        profile, choices = _fitted(choices)
        run = self._run(f"{profile.name}, {choices.mode}", run_experiment(choices, profile, _say))
        if run is not None:
            result = result_of(choices, media_of(profile, choices.adapts), run, round_trip_of(profile))
            self._findings.cells.append(Cell(choices, profile, result, run))
            self._keep()

    def grow(self, choices: Choices) -> None:
        profile, choices = _fitted(replace(choices, profile=GROWTH_PROFILE))
        self._findings.growth = self._run("growth", run_growth(choices, profile, _say))
        self._keep()

    def outage(self, choices: Choices, network: str | None) -> None:
        profile = OUTAGE_PROFILE if network is None else _loaded(network)
        found = self._run("outage", run_outages(choices, profile, _say))
        if found is not None:
            self._findings.outages.append(found)
            self._keep()

    def endure(self, choices: Choices, client: EnduranceClient) -> None:
        profile, choices = _fitted(choices)
        found = self._run(f"endurance, {profile.name}", run_endurance(choices, profile, client, _say))
        if found is not None:
            self._findings.endurances.append(found)
            _say(", ".join(f"{name} {found[name]}" for name in ENDURANCE_WORDS))
            self._keep()

    def _keep(self) -> None:
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            _write(self._findings.results(), str(self._folder / "results.json"))

    def _run(self, name: str, work: Coroutine[Any, Any, Found]) -> Found | None:
        try:
            return uvloop.run(work)
        except* (ProcessFailed, ConsoleError, TimeoutError) as errors:
            why = f"{name}: {_reason(errors)}"
        _say(why)
        self._findings.failed.append(why)
        return None

    def publish(self, json_to: str) -> None:
        findings = self._findings
        results = findings.results()
        text = render_table(cell.result for cell in findings.cells)
        if findings.cells:
            print(text, file=sys.stderr if json_to == "-" else sys.stdout)
        _write(results[0] if len(results) == 1 else results, json_to)
        if self._folder is not None:
            from lockstep.bench.experiment.judge.report import (
                write_report,  # needs matplotlib, which only the tests install
            )

            _say(f"the report is {write_report(findings, self._folder)}")
        if findings.failed:
            raise typer.Exit(EXIT_FAILED)
        if findings.broken:
            raise typer.Exit(EXIT_BROKEN)


def _reason(error: BaseException) -> str:
    """Describe the first cause of an error, since task groups wrap it."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return f"{type(error).__name__} {error}".strip()


def _loaded(network: str) -> Profile:
    try:
        return load_profile(network)
    except ProfileError as error:
        _say(str(error))
        raise typer.Exit(EXIT_USAGE) from error


def _fitted(choices: Choices) -> tuple[Profile, Choices]:
    """Return the profile, and the choices with its tolerance unless they have their own."""
    profile = _loaded(choices.profile)
    tolerance = media_of(profile).tolerance if choices.tolerance < 0 else choices.tolerance
    return profile, replace(choices, profile=profile.name, tolerance=tolerance)


def _write(found: Any, json_to: str) -> None:
    if json_to == "-":
        sys.stdout.write(json.dumps(found, ensure_ascii=False) + "\n")
    elif json_to:
        Path(json_to).write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")


def _say(text: str) -> None:
    typer.echo(f"lockstep experiment: {text}", err=True)
