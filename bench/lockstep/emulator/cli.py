"""`lockstep network PROFILE`, also `python -m lockstep.emulator PROFILE`."""

import asyncio
import json
import shlex
import subprocess
import sys
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import typer
import uvloop

from lockstep.emulator.errors import EmulatorError
from lockstep.emulator.impairment.deliveries import prefer_this_process
from lockstep.emulator.impairment.profile import Profile, load_profile, profile_names
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces
from lockstep.emulator.network import Network
from lockstep.emulator.orders import Impaired, obey
from lockstep.server.http.transport.serve import PortTaken, wait_for_signal
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["main", "network_command"]

EXIT_USAGE = 2
EXIT_PORT_TAKEN = 3


def network_command(
    profile: Annotated[str, typer.Argument(help=f"A network: {', '.join(profile_names())}, or the file of one.")],
    console: Annotated[
        str | None, typer.Option(help="The console's URL, or a link with a token, to put a proxy in front of.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="A robot bridge, tcp://host:port, to stand in front of.")] = None,
    host: Annotated[str, typer.Option(help="Address on which the proxy listens.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the proxy; 0 takes any free one.")] = 0,
    seed: Annotated[int, typer.Option(help="The same seed makes the same network.")] = 1,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="Print the addresses as one JSON line; with --namespaces what happened, at the end."
        ),
    ] = False,
    namespaces: Annotated[
        bool, typer.Option("--namespaces", help="Run --robot-side and --operator-side behind it instead; needs root.")
    ] = False,
    robot_side: Annotated[str | None, typer.Option(help=f"Command to run at {ROBOT_ADDRESS}.")] = None,
    operator_side: Annotated[str | None, typer.Option(help=f"Command to run at {OPERATOR_ADDRESS}.")] = None,
) -> None:
    """Put an emulated network in front of a console or a robot, until interrupted.

    While it runs, it obeys lines on standard input: "outage 5" lets nothing pass for 5 s, "hold 5" keeps packets
    meanwhile, "robot outage 5" and "robot hold 5" do so on the robot link, "cut" breaks its connections, "statistics"
    prints the counts so far as a JSON line.
    """
    try:
        loaded = load_profile(profile)
        if namespaces:
            if not robot_side or not operator_side:
                raise typer.BadParameter("--namespaces needs --robot-side COMMAND and --operator-side COMMAND")
            raise typer.Exit(uvloop.run(_run_namespaces(loaded, seed, robot_side, operator_side, as_json)))
        if console is None and robot is None:
            raise typer.BadParameter("give --console URL, --robot tcp://host:port, or both")
        made = Network(loaded, console_url=console, robot=_robot(robot), seed=seed, host=host, port=port)
        uvloop.run(_run(made, console, as_json))
    except EmulatorError as error:
        typer.echo(f"lockstep: {error}", err=True)
        raise typer.Exit(EXIT_USAGE) from error
    except PortTaken as error:
        typer.echo(f"lockstep: {error}; choose another with --port", err=True)
        raise typer.Exit(EXIT_PORT_TAKEN) from error


def _robot(address: str | None) -> tuple[str, int] | None:
    if address is None:
        return None
    try:
        parts = urlsplit(address)
        if parts.hostname and parts.port:
            return parts.hostname, parts.port
    except ValueError:
        pass
    raise typer.BadParameter("--robot takes tcp://host:port")


async def _run(network: Network, console: str | None, as_json: bool) -> None:
    prefer_this_process()
    async with network:
        link = "" if console is None else network.link(console)
        if as_json:
            print(json.dumps({"console": link, "robot": network.robot_address}), flush=True)
        else:
            _explain(network, link)
        await _until_signal(network)


def _explain(network: Network, link: str) -> None:
    print(f"{network.profile.title}, {network.profile.name}")
    if link:
        print(f"  open         {link}" + ("" if "#" in link else "  with the #token=… of the console's link"))
    if network.robot_address:
        print(f"  start        lockstep serve --robot {network.robot_address}")
    sys.stdout.flush()


async def _until_signal(network: Impaired) -> None:
    """Obeys orders meanwhile."""
    async with background_tasks(obey(network, print)):
        await wait_for_signal()


async def _run_namespaces(profile: Profile, seed: int, robot_side: str, operator_side: str, as_json: bool) -> int:
    """Ends with the operator's side, or by a signal; returns the exit code of the operator's side."""
    async with AsyncExitStack() as stack:
        spaces = await stack.enter_async_context(Namespaces(profile, seed=seed))
        first = await spaces.start("robot", shlex.split(robot_side), stdin=subprocess.DEVNULL)
        second = await spaces.start("operator", shlex.split(operator_side), stdin=subprocess.DEVNULL)
        print(
            f"robot's side     {ROBOT_ADDRESS}  enter it with nsenter --net=/proc/{first.pid}/ns/net", file=sys.stderr
        )
        print(f"operator's side  {OPERATOR_ADDRESS}  nsenter --net=/proc/{second.pid}/ns/net", file=sys.stderr)
        async with asyncio.TaskGroup() as tasks:
            ending = {tasks.create_task(_until_signal(spaces)), tasks.create_task(_wait(second))}
            await asyncio.wait(ending, return_when=asyncio.FIRST_COMPLETED)
            for each in ending:
                each.cancel()
        if as_json:
            print(json.dumps(spaces.statistics().fields()), flush=True)
        return second.returncode or 0


async def _wait(process: asyncio.subprocess.Process) -> None:
    await process.wait()


def main() -> None:
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(network_command)
    app(prog_name=f"{Path(sys.executable).name} -m lockstep.emulator")
