"""`lockstep robot`: run a bridge."""

import asyncio
import json
import logging
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer
import uvloop

from robot_bridge.bridge import Bridge
from robot_bridge.errors import BridgeError
from robot_bridge.robots.registry import create_robot, robot_names
from robot_bridge.settings import BridgeSettings

__all__ = ["main", "robot_app", "run"]

robot_app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@robot_app.callback(invoke_without_command=True, context_settings={"allow_interspersed_args": True})
def run(
    name: Annotated[str, typer.Argument(help=f"The robot: {', '.join(robot_names())}.")] = "mobile-manipulator",
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 takes any free one.")] = 5600,
    event_log: Annotated[
        Path | None, typer.Option(help="Append a JSON line for each event, refusal and medium.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the address as one JSON line once ready.")] = False,
) -> None:
    """Run a robot and its bridge until interrupted."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    settings = BridgeSettings(host=host, port=port, event_log=event_log)
    try:
        uvloop.run(_serve(name, settings, as_json))
    except BridgeError as error:
        typer.echo(f"lockstep robot: {error.detail}", err=True)
        raise typer.Exit(1) from error
    except OSError as error:
        typer.echo(f"lockstep robot: {error}", err=True)
        raise typer.Exit(1) from error


async def _serve(name: str, settings: BridgeSettings, as_json: bool) -> None:
    stopping = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopping.set)
    async with Bridge(create_robot(name), settings) as bridge:
        _announce(name, bridge, as_json)
        waits = {loop.create_task(stopping.wait()), loop.create_task(bridge.wait())}
        try:
            done, _ = await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waits:
                task.cancel()
        for task in done:
            task.result()
        bridge.report()


def _announce(name: str, bridge: Bridge, as_json: bool) -> None:
    host, port = bridge.address
    url = f"tcp://{f'[{host}]' if ':' in host else host}:{port}"
    typer.echo(json.dumps({"robot": url}) if as_json else f"{name} at {url}")
    sys.stdout.flush()


def main() -> None:
    """The robot's own entry point, without the console."""
    robot_app(prog_name="lockstep robot")
