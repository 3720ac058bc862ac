"""The command `lockstep`: `up` runs a robot and a console, `serve` only the console, `robot` only the robot …"""

import asyncio
import datetime
import gc
import json
import logging
import socket
import sys
from collections.abc import Coroutine
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
import uvloop
from pydantic import SecretStr, ValidationError

from robot_bridge.cli import robot_app
from robot_bridge.protocol.link_secret import LinkSecret
from robot_bridge.robots.registry import robot_names
from server.app import create_app
from server.bench_commands import add_bench_commands
from server.bridge_process import BridgeFailed, BridgeProcess
from server.cli_access import StateDirOption, add_access_commands
from server.cli_options import (
    AllowedHosts,
    Cameras,
    Microphones,
    ObserversDirect,
    PublicUrl,
    Record,
    Relay,
    Speaker,
    SpeedCap,
    Stun,
    Tls,
    TlsCert,
    TlsKey,
    Turn,
    TurnSecret,
)
from server.cli_recordings import add_recording_commands
from server.console_address import write_address
from server.guarded_http import guarded_by
from server.link_access import link_access
from server.links import ConsoleLinks, console_links, listening_url
from server.logs import LogFormat, configure_logs
from server.media.aiortc_private import own_addresses
from server.serve import PortTaken, bind, running, wait_for_signal
from server.services import Services
from server.settings import Settings
from server.state import ConsoleState, open_state
from server.state_dir import StateDirUnusable, default_state_dir
from server.tls import Certificate, fingerprint, own_names, self_signed

__all__ = ["app", "main"]

EXIT_USAGE = 2
EXIT_PORT_TAKEN = 3
EXIT_BRIDGE = 4
PATIENCE = 2.0  # s until somebody who waits for a robot is told so
# A worker thread of ours (encoders, the 3D scene) may hold the interpreter this long while a command waits.
SWITCH_INTERVAL = 0.0005  # s; Python's own is ten times that
GC_THRESHOLDS = (5_000, 20, 10)  # allocations, young collections, middle collections


class Switch(StrEnum):
    ON = "on"
    OFF = "off"


app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__)
app.add_typer(robot_app, name="robot")
add_bench_commands(app)

Host = Annotated[str | None, typer.Option(help="Address to listen on; 127.0.0.1 unless set.")]
Port = Annotated[int | None, typer.Option(min=0, max=65535, help="Port of the console; 0 takes any free one.")]
Json = Annotated[bool, typer.Option("--json", help="Print the links as one JSON line, once ready.")]
IceHosts = Annotated[
    list[str] | None, typer.Option("--ice-host", help="Address offered to browsers for media; may be given again.")
]
Quality = Annotated[
    Switch | None, typer.Option(help="Whether bitrate, rate and size of pictures follow the network; on unless set.")
]
LogFormatOption = Annotated[LogFormat | None, typer.Option("--log-format", help="Log lines as text or as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Log only warnings.")]


@app.command()
def up(
    robot: Annotated[str, typer.Option(help=f"The robot: {', '.join(robot_names())}.")] = "mobile-manipulator",
    ros2: Annotated[
        Path | None, typer.Option(help="Instead: a robot behind ROS 2 topics, described by this YAML file.")
    ] = None,
    mjcf: Annotated[Path | None, typer.Option(help="Instead: a MuJoCo model of your own, this MJCF file.")] = None,
    robot_python: Annotated[
        str | None,
        typer.Option(
            envvar="LOCKSTEP_ROBOT_PYTHON", help="Python that runs the bridge, as that of a ROS installation; or ours."
        ),
    ] = None,
    robot_port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the bridge; 0 takes any free one.")] = 5600,
    event_log: Annotated[Path | None, typer.Option(help="The bridge appends what happens to events here.")] = None,
    host: Host = None,
    port: Port = None,
    ice_host: IceHosts = None,
    camera: Cameras = None,
    microphone: Microphones = None,
    speaker: Speaker = None,
    quality: Quality = None,
    speed_cap: SpeedCap = None,
    record: Record = None,
    relay: Relay = None,
    observers_direct: ObserversDirect = None,
    public_url: PublicUrl = None,
    allowed_host: AllowedHosts = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    stun: Stun = None,
    turn: Turn = None,
    turn_secret: TurnSecret = None,
    as_json: Json = False,
    quiet: Quiet = False,
    log_format: LogFormatOption = None,
    state_dir: StateDirOption = None,
) -> None:
    """Run a simulated robot and the console, and print the links that open it."""
    network = _network(public_url, allowed_host, tls, tls_cert, tls_key, stun, turn, turn_secret)
    settings = _settings(
        host=host,
        port=port,
        ice_hosts=ice_host,
        media=_media(quality),
        cameras=_words(camera),
        microphones=_words(microphone),
        speaker=speaker,
        speed_cap=speed_cap,
        recording=_recording(record),
        relay=relay,
        observers_direct=observers_direct,
        log_format=log_format,
        state_dir=state_dir,
        **network,
    )
    options = [] if event_log is None else ["--event-log", str(event_log)]
    options += [] if ros2 is None else ["--ros2", str(ros2)]
    options += [] if mjcf is None else ["--mjcf", str(mjcf)]
    secret = link_access(settings).secret or LinkSecret.draw()
    settings = settings.model_copy(update={"link_secret": SecretStr(secret.reveal()), "link_secret_file": None})
    bridge = BridgeProcess(robot, "127.0.0.1", robot_port, options, secret.reveal(), _say, robot_python)
    _run(settings, bridge, as_json, quiet)


@app.command()
def serve(
    robot: Annotated[
        str | None, typer.Option(help="Where the robot bridge is, tcp://host:port or tls://host:port.")
    ] = None,
    link_secret_file: Annotated[
        Path | None, typer.Option(help="File with the secret that the bridge asks for; or LOCKSTEP_LINK_SECRET.")
    ] = None,
    link_tls_ca: Annotated[Path | None, typer.Option(help="What signed the bridge's certificate.")] = None,
    link_tls_cert: Annotated[Path | None, typer.Option(help="Certificate to show to a bridge that asks.")] = None,
    link_tls_key: Annotated[Path | None, typer.Option(help="Its key, if it stands in another file.")] = None,
    host: Host = None,
    port: Port = None,
    ice_host: IceHosts = None,
    camera: Cameras = None,
    microphone: Microphones = None,
    speaker: Speaker = None,
    quality: Quality = None,
    speed_cap: SpeedCap = None,
    record: Record = None,
    relay: Relay = None,
    observers_direct: ObserversDirect = None,
    public_url: PublicUrl = None,
    allowed_host: AllowedHosts = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    stun: Stun = None,
    turn: Turn = None,
    turn_secret: TurnSecret = None,
    as_json: Json = False,
    quiet: Quiet = False,
    log_format: LogFormatOption = None,
    state_dir: StateDirOption = None,
) -> None:
    """Run the console for a robot bridge that runs elsewhere."""
    network = _network(public_url, allowed_host, tls, tls_cert, tls_key, stun, turn, turn_secret)
    settings = _settings(
        robot=robot,
        link_secret_file=link_secret_file,
        link_tls_ca=link_tls_ca,
        link_tls_cert=link_tls_cert,
        link_tls_key=link_tls_key,
        host=host,
        port=port,
        ice_hosts=ice_host,
        media=_media(quality),
        cameras=_words(camera),
        microphones=_words(microphone),
        speaker=speaker,
        speed_cap=speed_cap,
        recording=_recording(record),
        relay=relay,
        observers_direct=observers_direct,
        log_format=log_format,
        state_dir=state_dir,
        **network,
    )
    _run(settings, None, as_json, quiet)


def _media(quality: Switch | None) -> dict[str, bool] | None:
    return None if quality is None else {"quality": quality is Switch.ON}


def _words(texts: list[str] | None) -> tuple[str, ...] | None:
    """As a setting that is given several times, and may hold any character."""
    return tuple(texts) if texts else None


def _recording(directory: Record) -> dict[str, object] | None:
    return None if directory is None else {"directory": directory, "automatic": True}


def _network(
    public_url: PublicUrl,
    allowed_hosts: AllowedHosts,
    tls: Tls,
    tls_cert: TlsCert,
    tls_key: TlsKey,
    stun: Stun,
    turn: Turn,
    turn_secret: TurnSecret,
) -> dict[str, object]:
    """The arguments by the names of their settings."""
    return dict(locals())


def _settings(**flags: object) -> Settings:
    """What the environment says, overridden by the flags that were given."""
    given = {name: value for name, value in flags.items() if value is not None and value != []}
    given = {name: ",".join(value) if isinstance(value, list) else value for name, value in given.items()}
    try:
        return Settings(**given)  # type: ignore[arg-type]
    except ValidationError as error:
        for each in error.errors():
            typer.echo(f"lockstep: {'.'.join(map(str, each['loc'])) or 'robot'}: {each['msg']}", err=True)
        raise typer.Exit(EXIT_USAGE) from error


def _run(settings: Settings, bridge: BridgeProcess | None, as_json: bool, quiet: bool) -> None:
    configure_logs(logging.WARNING if quiet else logging.INFO, settings.log_format)
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        _check_files(settings)
        listener = bind(settings.host, settings.port)
        state = open_state(settings, fall_back=True)
        uvloop.run(_serve(settings, state, listener, bridge, as_json))
    except PortTaken as error:
        _say(f"{error}; choose another with --port")
        raise typer.Exit(EXIT_PORT_TAKEN) from error
    except StateDirUnusable as error:
        _say(str(error))
        raise typer.Exit(EXIT_USAGE) from error
    except BridgeFailed as error:
        _say(str(error))
        raise typer.Exit(EXIT_BRIDGE) from error


def _check_files(settings: Settings) -> None:
    """Before anything runs."""
    try:
        for path in (settings.tls_cert, settings.tls_key):
            if path is not None:
                path.read_bytes()
    except OSError as error:
        _say(f"{error.filename}: {error.strerror}")
        raise typer.Exit(EXIT_USAGE) from error


def _calm_garbage_collection() -> None:
    """A full collection over all modules stalls the loop by 100 ms and more with a hundred peers.

    What lives now lives until the end, so it is taken out of the collector's sight; the rest is looked at less often.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)


async def _serve(
    settings: Settings, state: ConsoleState, listener: socket.socket, bridge: BridgeProcess | None, as_json: bool
) -> None:
    """Until a signal: the bridge first, then the console; the console ends first."""
    certificate = _certificate(settings)
    stopping = asyncio.get_running_loop().create_task(wait_for_signal())
    try:
        if bridge is not None:
            address = await _unless(stopping, bridge.start())
            if address is None:
                return
            settings = settings.model_copy(update={"robot": address})
        application = create_app(settings, state)
        http = guarded_by(settings, application)
        async with running(application, listener, http=http, tls=certificate), asyncio.TaskGroup() as tasks:
            _calm_garbage_collection()
            watching = None if bridge is None else tasks.create_task(bridge.watch())
            url = listening_url(settings, listener)
            links = console_links(settings, url, state)
            with suppress(StateDirUnusable):  # `lockstep invite` then needs --url
                write_address(state.directory, url)
            announcing = tasks.create_task(_announce(application.state.services, links, as_json))
            await stopping
            for task in (watching, announcing):
                if task is not None:
                    task.cancel()
    finally:
        listener.close()
        stopping.cancel()
        with suppress(asyncio.CancelledError):
            await stopping
        if bridge is not None:
            await bridge.close()


def _certificate(settings: Settings) -> Certificate | None:
    """What to encrypt HTTP with; None: not at all."""
    if settings.tls_cert is not None and settings.tls_key is not None:
        return Certificate(settings.tls_cert, settings.tls_key)
    if not settings.tls:
        return None
    names = own_names(settings.host) | set(settings.tls_names) | set(settings.own_names) | set(own_addresses())
    certificate = self_signed(
        settings.state_dir or default_state_dir(), names - {"*"}, datetime.datetime.now(datetime.UTC)
    )
    _say(f"the certificate is our own; its SHA-256 fingerprint is {fingerprint(certificate)}")
    return certificate


async def _unless(stopping: asyncio.Task[None], starting: Coroutine[None, None, str]) -> str | None:
    """What `starting` returns; None when we are asked to stop first."""
    task = asyncio.get_running_loop().create_task(starting)
    await asyncio.wait((task, stopping), return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        return task.result()
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task
    return None


async def _announce(here: Services, links: ConsoleLinks, as_json: bool) -> None:
    """The links, once they lead to a robot. For people at once when the robot is not there yet."""
    robot = here.console.robot
    if not as_json and not robot.up:
        with suppress(TimeoutError):
            async with asyncio.timeout(PATIENCE):
                await robot.reached.wait()
        if not robot.up:
            _say(f"waiting for the robot at {links.robot}: {robot.detail}")
    await robot.reached.wait()
    sys.stdout.write(json.dumps(links._asdict()) + "\n" if as_json else links.for_people())
    sys.stdout.flush()


add_access_commands(app, _settings)
add_recording_commands(app, _settings)


def _say(text: str) -> None:
    typer.echo(f"lockstep: {text}", err=True)


def main() -> None:
    app()
