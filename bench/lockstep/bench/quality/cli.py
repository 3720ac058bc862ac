"""`python -m lockstep.bench.quality delay | freezes | repair`: the controller and the repair of losses."""

import asyncio
import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.harness.stack import running_stack
from lockstep.bench.quality.repair import simulate
from lockstep.bench.quality.stage import driving
from lockstep.bench.quality.summary import summarise, timeline
from lockstep.emulator import Profile, load_profile, parse_profile

__all__ = ["app"]

LOOK_SECONDS = 1.5
BUSY_PERCENT = 8.0
LOSSY = """
title = "Loss"
about = "A path that loses packets."

[client]
round_trip_ms = {round_trip_ms}
loss_percent = {percent}
burst_packets = {burst}
"""

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__)

Seconds = Annotated[float, typer.Option(min=5, help="Of each drive.")]
Tolerance = Annotated[int, typer.Option(min=1, help="Largest gap of a picture, in events.")]
Seed = Annotated[int, typer.Option(help="Of the network.")]
Robot = Annotated[str, typer.Option(help="The simulated robot.")]
Codec = Annotated[str | None, typer.Option(help="VP8 or H264; the console's first choice unless set.")]
JsonTo = Annotated[str, typer.Option("--json", help="Write the results there as JSON; - is standard output.")]


@app.command()
def delay(
    profiles: Annotated[
        list[str] | None, typer.Argument(help="Networks; narrow-uplink and lte-drive unless set.")
    ] = None,
    seconds: Seconds = 60.0,
    tolerance: Tolerance = 4,
    seed: Seed = 1,
    robot: Robot = "mobile-manipulator",
    codec: Codec = None,
    modes: Annotated[str, typer.Option(help="Of the controller, in this order.")] = "off,on",
    json_to: JsonTo = "",
    svg: Annotated[Path | None, typer.Option(help="Draw the delay over time there.")] = None,
) -> None:
    """Command-to-picture delay over time with the controller off and on."""
    results: dict[str, Any] = {}
    _say_machine()
    for name in profiles or ["narrow-uplink", "lte-drive"]:
        for mode in modes.split(","):
            found = asyncio.run(_drive(load_profile(name), mode == "on", seconds, tolerance, seed, robot, codec))
            results.setdefault(name, {})[mode] = found
            print(f"{name}, controller {mode}: {_line(found['summary'])}", file=sys.stderr, flush=True)
    _publish(results, json_to)
    if svg is not None:
        from lockstep.bench.quality.figure import draw  # needs matplotlib, which only the tests install

        draw(results, svg)


@app.command()
def freezes(
    losses: Annotated[list[float] | None, typer.Argument(help="Percent; 1, 3, 5 and 10 unless set.")] = None,
    seconds: Seconds = 60.0,
    tolerance: Tolerance = 4,
    seed: Seed = 1,
    robot: Robot = "mobile-manipulator",
    codec: Codec = None,
    round_trip_ms: Annotated[float, typer.Option(min=0, help="Of the network.")] = 60.0,
    burst: Annotated[float, typer.Option(min=1, help="Packets that are lost together, on average.")] = 1.0,
    json_to: JsonTo = "",
) -> None:
    """Freezes per minute of the pictures within tolerance, by packet loss in both directions."""
    results: dict[str, Any] = {}
    _say_machine()
    for percent in losses or [1.0, 3.0, 5.0, 10.0]:
        text = LOSSY.format(round_trip_ms=round_trip_ms, percent=percent, burst=burst)
        found = asyncio.run(_drive(parse_profile(text, "--loss"), True, seconds, tolerance, seed, robot, codec))
        results[f"{percent:g} %"] = found["summary"]
        print(f"{percent:g} % lost: {_line(found['summary'])}", file=sys.stderr, flush=True)
    _publish(results, json_to)


@app.command()
def repair(
    losses: Annotated[list[float] | None, typer.Argument(help="Percent; 1, 3, 5 and 10 unless set.")] = None,
    seconds: Seconds = 600.0,
    seed: Seed = 1,
    round_trip_ms: Annotated[float, typer.Option(min=0, help="Of the network.")] = 60.0,
    burst: Annotated[float, typer.Option(min=1, help="Packets that are lost together, on average.")] = 1.0,
    json_to: JsonTo = "",
) -> None:
    """Freezes per minute by packet loss in both directions, with and without retransmission, in simulated time."""
    results: dict[str, Any] = {}
    for percent in losses or [1.0, 3.0, 5.0, 10.0]:
        for retransmit, name in ((False, "keyframes only"), (True, "repaired")):
            found = simulate(
                loss=percent / 100,
                round_trip=round_trip_ms / 1000,
                seconds=seconds,
                seed=seed,
                burst=burst,
                retransmit=retransmit,
            ).figures(seconds)
            results.setdefault(f"{percent:g} %", {})[name] = found
            print(f"{percent:g} % lost, {name}: {_line(found)}", file=sys.stderr, flush=True)
    _publish(results, json_to)


def _say_machine() -> None:
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    neighbours = f"others use {busy:.0f} % of this machine"
    print(
        f"{neighbours}{': too much to quote the figures' if busy > BUSY_PERCENT else ''}", file=sys.stderr, flush=True
    )


async def _drive(
    profile: Profile, quality: bool, seconds: float, tolerance: int, seed: int, robot: str, codec: str | None
) -> dict[str, Any]:
    async with running_stack(robot, LOCKSTEP_MEDIA__QUALITY=str(quality).lower()) as stack:
        drive = await driving(stack, profile, seconds=seconds, tolerance=tolerance, seed=seed, codec=codec)
    return {"summary": summarise(drive, seconds), "timeline": timeline(drive, seconds)}


def _line(summary: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in summary.items())


def _publish(results: dict[str, Any], json_to: str) -> None:
    text = json.dumps(results, indent=1) + "\n"
    if json_to == "-":
        sys.stdout.write(text)
    elif json_to:
        Path(json_to).write_text(text)
