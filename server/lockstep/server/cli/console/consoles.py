"""The commands that run a console: `up`, with a simulated robot, and `serve`."""

import contextlib
import logging
import os
import ssl
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
import uvloop
from pydantic import SecretStr

from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.encoding.encoder_choice import ENCODERS
from lockstep.robot_bridge.robots.registry import is_robot, robot_names, simulated_names
from lockstep.server.cli.console.console_options import ConsoleOptions
from lockstep.server.cli.console.run_console import ConsoleFailed, run_console, say
from lockstep.server.cli.console.unknown_settings import unknown_settings
from lockstep.server.cli.extras import load_extra
from lockstep.server.cli.option_group import with_options
from lockstep.server.cli.settings_from_flags import make_settings
from lockstep.server.federation import check_board
from lockstep.server.federation.errors import BoardUnusable
from lockstep.server.fleet.robots import robot_settings
from lockstep.server.fleet.simulated import own_event_log, own_state_dir, simulated_robots
from lockstep.server.http.transport.serve import PortTaken, bind
from lockstep.server.robot.bridge_process import BridgeFailed, BridgeProcess
from lockstep.server.robot.credentials import link_access
from lockstep.server.settings import Settings
from lockstep.server.settings_file import SettingsFileUnusable, exposed_secrets
from lockstep.server.state.persistent_state import open_state
from lockstep.server.telemetry.logs import configure_logs
from lockstep.server.util.process.file_limit import raise_file_limit
from lockstep.server.util.process.glibc_malloc import share_arenas
from lockstep.server.util.robot_names import BadFleet, is_named
from lockstep.server.util.state_dir import StateDirUnusable, default_state_dir
from lockstep.server.webrtc.media_addresses import MediaAddressUnusable, check_media_addresses

__all__ = ["commands"]

DEFAULT_ROBOT = "mobile-manipulator"
EXIT_FAILED = 1
EXIT_USAGE = 2
EXIT_PORT_TAKEN = 3
EXIT_BRIDGE = 4
NO_NAMES = "a board needs robots with names that no other console has: --robot NAME=tcp://…"
# A worker thread (encoders, the 3D scene) may hold the interpreter this long while a command waits.
SWITCH_INTERVAL = 0.0005  # s; Python's own is ten times that


commands = typer.Typer()


@commands.command()
@with_options(ConsoleOptions)
def up(
    robot: Annotated[
        list[str] | None,
        typer.Option(
            help=f"The robot: {', '.join(simulated_names())}, the name of an installed one, or module:Class; "
            f"default: {DEFAULT_ROBOT}. Repeat it, or give NAME=robot, for a fleet: docs/fleet.md."
        ),
    ] = None,
    ros2: Annotated[
        Path | None, typer.Option(help="Use a robot behind ROS 2 topics instead; this YAML file describes it.")
    ] = None,
    mjcf: Annotated[Path | None, typer.Option(help="Use your own MuJoCo model instead, from this MJCF file.")] = None,
    lerobot: Annotated[
        Path | None, typer.Option(help="Use a robot of LeRobot instead; this YAML file describes it.")
    ] = None,
    robot_python: Annotated[
        str | None,
        typer.Option(
            envvar="LOCKSTEP_ROBOT_PYTHON",
            help="Python interpreter for the bridge, such as that of ROS or LeRobot. Default: the console's own.",
        ),
    ] = None,
    robot_port: Annotated[
        int,
        typer.Option(
            min=0, max=65535, help="Port of the bridge, or of the first of several bridges; 0: any free port."
        ),
    ] = 5600,
    event_log: Annotated[
        Path | None, typer.Option(help="File to which the bridge appends a line for each event.")
    ] = None,
    event_strip: Annotated[
        bool, typer.Option(help="Draw the event's number into each picture, for tests and measurements.")
    ] = False,
    encode: Annotated[
        str | None,
        typer.Option(help=f"Encode pictures in the robot bridge, as over a narrow uplink: {', '.join(ENCODERS)}."),
    ] = None,
    *,
    options: ConsoleOptions,
) -> None:
    """Run a simulated robot and the console, and print the links that open it."""
    settings = make_settings(**options.settings())
    file = ros2 or mjcf or lerobot
    arguments = [] if ros2 is None else ["--ros2", str(ros2)]
    arguments += [] if mjcf is None else ["--mjcf", str(mjcf)]
    arguments += [] if lerobot is None else ["--lerobot", str(lerobot)]
    arguments += ["--event-strip"] if event_strip else []
    arguments += [] if encode is None else ["--encode", encode]
    secret = link_access(settings).secret or LinkSecret.draw()
    settings = settings.model_copy(update={"link_secret": SecretStr(secret.reveal()), "link_secret_file": None})
    bridges = {}
    kinds = _simulated(robot)
    if file is not None and "" not in kinds:
        raise _usage(
            "--ros2, --mjcf and --lerobot are for one robot; "
            "run the others by `lockstep robot` and use `lockstep serve`"
        )
    unknown = [] if file or robot_python else sorted(kind for kind in kinds.values() if not is_robot(kind))
    if unknown:
        raise _usage(f"no robot {unknown[0]!r}; there are {', '.join(robot_names())}")
    for number, (name, kind) in enumerate(kinds.items()):
        called = name or (kind if file is None else file.stem)
        own = ["--state-dir", str(own_state_dir(settings.state_dir or default_state_dir(), called))]
        own += [] if event_log is None else ["--event-log", str(own_event_log(event_log, name))]
        port_of_bridge = robot_port + number if robot_port else 0
        bridges[name] = BridgeProcess(
            kind, "127.0.0.1", port_of_bridge, [*arguments, *own], secret.reveal(), say, robot_python
        )
    if "" not in bridges:  # their addresses are known when they run
        settings = settings.model_copy(update={"robots": tuple(f"{name}=tcp://127.0.0.1:1" for name in bridges)})
    is_own = any(kind not in simulated_names() for kind in kinds.values())
    _run(settings, bridges, options, is_own)


@commands.command()
@with_options(ConsoleOptions)
def serve(
    robot: Annotated[
        list[str] | None,
        typer.Option(
            help="Address of the robot bridge, tcp://host:port or tls://host:port; dial-in: the robot connects to this "
            "console (`lockstep robot --console`). NAME=tcp://… or NAME=dial-in names a robot of a fleet; repeat for "
            "several, docs/fleet.md.",
        ),
    ] = None,
    fleet: Annotated[
        Path | None, typer.Option(help="TOML file with a table for each robot of a fleet, docs/fleet.md.")
    ] = None,
    link_secret_file: Annotated[
        Path | None, typer.Option(help="File with the secret of the robot link; or set LOCKSTEP_LINK_SECRET.")
    ] = None,
    link_tls_ca: Annotated[
        Path | None, typer.Option(help="CA certificate that signed the bridge's certificate.")
    ] = None,
    link_tls_cert: Annotated[
        Path | None, typer.Option(help="Client certificate for a bridge that asks for one.")
    ] = None,
    link_tls_key: Annotated[
        Path | None, typer.Option(help="Private key of that certificate, if it is in another file.")
    ] = None,
    *,
    options: ConsoleOptions,
) -> None:
    """Run the console for a robot bridge that runs elsewhere."""
    settings = make_settings(
        **_robots(robot),
        fleet_file=fleet,
        link_secret_file=link_secret_file,
        link_tls_ca=link_tls_ca,
        link_tls_cert=link_tls_cert,
        link_tls_key=link_tls_key,
        **options.settings(),
    )
    _run(settings, {}, options)


def _robots(given: list[str] | None) -> dict[str, object]:
    """Return the robots' settings. One address alone is the only robot of a console; anything else is a fleet."""
    if not given:
        return {}
    if len(given) == 1 and not is_named(given[0]):
        return {"robot": given[0]}
    return {"robots": tuple(given)}


def _simulated(given: list[str] | None) -> dict[str, str]:
    """Return the kinds of the robots to run, by name; "" is the only robot of a console."""
    try:
        return simulated_robots(given or [DEFAULT_ROBOT])
    except BadFleet as error:
        raise _usage(f"robot: {error}") from error


def _warn_of_open_files(settings: Settings) -> None:
    """Tell of files of settings that hold a secret and that everybody on this machine may read."""
    for path in {each for each in (settings.config, settings.fleet_file) if each is not None}:
        with contextlib.suppress(SettingsFileUnusable):  # the console says so itself, or runs without the file by now
            for name in exposed_secrets(path, Settings):
                say(f"{path} holds {name}, and everybody on this machine may read it: chmod o-r {path}")


def _run(
    settings: Settings,
    bridges: Mapping[str, BridgeProcess],
    options: ConsoleOptions,
    own_robot: bool = False,
) -> None:
    """Run the console. `own_robot`: a robot is the user's own class, which its bridge may fail to find."""
    configure_logs(logging.WARNING if options.quiet else logging.INFO, settings.log_format)
    for each in unknown_settings(os.environ, Settings):
        say(each)
    _warn_of_open_files(settings)
    sys.setswitchinterval(SWITCH_INTERVAL)
    share_arenas()
    raise_file_limit()
    try:
        _check_files(settings)
        check_media_addresses(settings)
        check_board(settings, settings.public_url)
        each_robot = [settings]
        if settings.is_fleet:
            each_robot = list(robot_settings(settings).values())
        elif settings.has_board:
            raise BoardUnusable(NO_NAMES)
        if any(each.foxglove.port is not None for each in each_robot):
            load_extra("foxglove", "foxglove")
        if any(each.rerun.to is not None for each in each_robot):
            load_extra("rerun", "rerun")
        listener = bind(settings.host, settings.port)
        state = open_state(settings, fall_back=True)
        uvloop.run(run_console(settings, state, listener, bridges, options.as_json))
    except PortTaken as error:
        say(f"{error}; choose another with --port")
        raise typer.Exit(EXIT_PORT_TAKEN) from error
    except (StateDirUnusable, BadFleet, BoardUnusable, MediaAddressUnusable) as error:
        raise _usage(str(error)) from error
    except ssl.SSLError as error:
        raise _usage(f"tls_cert and tls_key are not a certificate chain and its key: {error}") from error
    except BridgeFailed as error:
        if own_robot and error.code == EXIT_USAGE:  # the bridge itself has said what is wrong
            raise typer.Exit(EXIT_USAGE) from error
        say(str(error))
        raise typer.Exit(EXIT_BRIDGE) from error
    except ConsoleFailed as error:
        say("the console has failed and ends; the log says why. Start the console again")
        raise typer.Exit(EXIT_FAILED) from error


def _check_files(settings: Settings) -> None:
    """Check the certificate files before anything runs."""
    try:
        for path in (settings.tls_cert, settings.tls_key):
            if path is not None:
                path.read_bytes()
    except OSError as error:
        say(f"{error.filename}: {error.strerror}")
        raise typer.Exit(EXIT_USAGE) from error


def _usage(text: str) -> typer.Exit:
    say(text)
    return typer.Exit(EXIT_USAGE)
