"""`lockstep experiment`."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
import uvloop

from bench.emulator.errors import ProfileError
from bench.emulator.profile import Profile, load_profile
from bench.experiment.choices import PROFILES, Choices, Mode, media_of
from bench.experiment.outage import run_outages
from bench.experiment.results import Result, result_of
from bench.experiment.run import run_experiment
from bench.experiment.table import render_table
from bench.processes import ProcessFailed
from client.errors import ConsoleError
from robot_bridge.robots.registry import robot_names

__all__ = ["experiment_command"]

EXIT_BROKEN = 1  # a verdict is false
EXIT_USAGE = 2
EXIT_FAILED = 3  # something did not run


def experiment_command(
    profile: Annotated[
        str, typer.Argument(help=f"A network: {', '.join(PROFILES)}, or the file of one; or all; growth; outage.")
    ],
    mode: Annotated[
        Mode, typer.Option(help="off: no gate; age: a gate by age; feedback: the thesis' rule; media: media pacing.")
    ] = "feedback",
    seconds: Annotated[float, typer.Option(min=1, max=3600, help="How long the operator drives.")] = 25.0,
    tolerance: Annotated[
        int | None, typer.Option(min=0, max=1000, help="Largest gap, in events; unless given, the profile's own.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the network and the operator.")] = 1,
    robot: Annotated[str, typer.Option(help=f"{', '.join(robot_names())}.")] = "planar",
    browser: Annotated[bool, typer.Option("--browser", help="The operator is a page in Chromium.")] = False,
    watchers: Annotated[
        bool | None,
        typer.Option(help="Clients in the other gate modes beside the operator; unless given, without a browser."),
    ] = None,
    json_to: Annotated[str, typer.Option("--json", help="Write the figures there; - is standard output.")] = "",
    report: Annotated[Path | None, typer.Option(help="Write a page with the figures into this folder.")] = None,
) -> None:
    """Drive a robot over an emulated network and say what was rendered, and how far behind the robot it was."""
    if profile == "outage":
        _outage(Choices(profile, mode, seconds, 0, seed, robot, browser), json_to)
        return
    try:
        found = load_profile(profile)
    except ProfileError as error:
        _say(str(error))
        raise typer.Exit(EXIT_USAGE) from error
    choices = Choices(
        profile=found.name,
        mode=mode,
        seconds=seconds,
        tolerance=media_of(found).tolerance if tolerance is None else tolerance,
        seed=seed,
        robot=robot,
        browser=browser,
        watchers=not browser if watchers is None else watchers,
    )
    result = _run(choices, found)
    _publish(result, [result], json_to)
    if False in result["verdicts"].values():
        raise typer.Exit(EXIT_BROKEN)


def _run(choices: Choices, profile: Profile) -> Result:
    try:
        run = uvloop.run(run_experiment(choices, profile, _say))
    except* (ProcessFailed, ConsoleError, TimeoutError) as errors:
        _say(f"{choices.profile}, {choices.mode}: {errors.exceptions[0]}")
        raise typer.Exit(EXIT_FAILED) from errors
    return result_of(choices, media_of(profile), run, round_trip(profile))


def _outage(choices: Choices, json_to: str) -> None:
    try:
        found = uvloop.run(run_outages(choices, _say))
    except* (ProcessFailed, ConsoleError, TimeoutError) as errors:
        _say(f"outage: {errors.exceptions[0]}")
        raise typer.Exit(EXIT_FAILED) from errors
    for each in found["outages"]:
        _say(", ".join(f"{name} {value}" for name, value in each.items()))
    _write(found, json_to)
    if False in found["verdicts"].values():
        raise typer.Exit(EXIT_BROKEN)


def round_trip(profile: Profile) -> float:
    """Mean time of a command to the robot and its feedback back, in s, without what the programs take."""
    paths = (profile.control, profile.robot_control)
    return sum(path.to_operator.delay.mean + path.to_robot.delay.mean for path in paths)


def _publish(found: Any, results: list[Result], json_to: str) -> None:
    print(render_table(results), file=sys.stderr if json_to == "-" else sys.stdout)
    _write(found, json_to)


def _write(found: Any, json_to: str) -> None:
    if json_to == "-":
        sys.stdout.write(json.dumps(found, ensure_ascii=False) + "\n")
    elif json_to:
        Path(json_to).write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n")


def _say(text: str) -> None:
    typer.echo(f"lockstep experiment: {text}", err=True)
