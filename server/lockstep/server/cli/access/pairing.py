"""The commands `pair` and `forget`, about robots that dial in: what a supervisor's page does, for scripts."""

import ipaddress
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

import msgspec
import typer

from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.console_request import ask_by_link, ask_console, read_answer
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.util.display_names import escaped, printable

__all__ = ["add_pairing_commands"]

EXIT_UNPAIRED = 1
LOOK_SECONDS = 1.0
STORED_LOOKS = 30  # until a key that a robot has got by the code is on the console's disk
NOT_ELSEWHERE = (
    "warning: {host} in this command is the robot's own computer, so only a robot on the console's machine can dial it."
    " Start the console with --public-url (LOCKSTEP_PUBLIC_URL), the address by which robots reach it, and with --host"
    " if it listens on loopback alone"
)

Ask = Callable[[str, str], dict[str, Any]]
Link = Annotated[
    str,
    typer.Option(
        envvar="LOCKSTEP_LINK",
        help="A supervisor's link, for a console elsewhere; the environment keeps it out of lists of processes. "
        "Unset: the console of the state directory.",
    ),
]
TlsCa = Annotated[
    Path | None, typer.Option(help="A certificate to trust for the link, such as a console's own tls-cert.pem.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


class _Code(msgspec.Struct):
    """The answer of POST /api/dial-in/code."""

    command: str
    seconds: float
    tries: int


class _Pairing(msgspec.Struct):
    state: str
    refused: str = ""


class _Waiting(msgspec.Struct):
    address: str
    name: str
    why: str


class _DialIn(msgspec.Struct):
    """The answer of GET /api/dial-in, and of what changes it."""

    key: str
    pairing: _Pairing
    robot: str = ""
    dials_in: bool = True
    state: str = ""
    address: str = ""
    waits: list[_Waiting] = []


def add_pairing_commands(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the commands. `make_settings` turns flags into settings, as for the other commands."""

    def asking(link: str, tls_ca: Path | None, robot: str, state_dir: Path | None) -> Ask:
        if link:
            return lambda method, path: ask_by_link(link, tls_ca, robot, method, path)
        settings = make_settings(state_dir=state_dir)
        return lambda method, path: ask_console(settings, robot, method, path)

    @app.command()
    def pair(
        wait: Annotated[
            bool, typer.Option("--wait", help="Wait until a robot is paired; exit code 1 if none.")
        ] = False,
        withdraw: Annotated[bool, typer.Option("--withdraw", help="Withdraw the open code instead.")] = False,
        status: Annotated[
            bool, typer.Option("--status", help="Print instead which robot is paired, and which robots wait.")
        ] = False,
        robot: RobotOption = "",
        link: Link = "",
        tls_ca: TlsCa = None,
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Open a code by which one robot pairs with the console, and print the command for the robot's computer."""
        ask = asking(link, tls_ca, robot, state_dir)
        if status:
            found = ask("GET", "/api/dial-in")
            _print(found, as_json, _status(read_answer(_DialIn, found)))
            return
        if withdraw:
            found = ask("DELETE", "/api/dial-in/code")
            read_answer(_DialIn, found)
            _print(found, as_json, "the code is withdrawn")
            return
        answer = ask("POST", "/api/dial-in/code")
        made = read_answer(_Code, answer)
        _print(answer, as_json, printable(made.command))
        typer.echo(f"lockstep: the code is good once, for {made.seconds:.0f} s and {made.tries} tries", err=True)
        if host := _loopback_host(made.command):
            typer.echo(f"lockstep: {escaped(NOT_ELSEWHERE.format(host=host))}", err=True)
        if wait and not _is_paired(ask):
            raise typer.Exit(EXIT_UNPAIRED)

    @app.command()
    def forget(
        robot: RobotOption = "",
        link: Link = "",
        tls_ca: TlsCa = None,
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Forget the paired robot: its links end at once, and it does not come in again."""
        found = asking(link, tls_ca, robot, state_dir)("DELETE", "/api/dial-in/robot")
        read_answer(_DialIn, found)
        _print(found, as_json, "the robot is forgotten")


def _status(found: _DialIn) -> str:
    if not found.dials_in:
        return "the console connects to this robot, so nothing is paired"
    name = escaped(found.robot) or "the robot"
    lines = [f"{name} is {escaped(found.state)}" if found.key else "no robot is paired"]
    if found.address:
        lines[0] += f" from {escaped(found.address)}"
    for each in found.waits:
        lines.append(f"waits: {escaped(each.name) or 'a robot'} at {escaped(each.address)}: {escaped(each.why)}")
    return "\n".join(lines)


def _loopback_host(command: str) -> str:
    """Return the host behind `--console` if a machine means itself by it; "" otherwise."""
    _, _, rest = command.partition("--console ")
    try:
        host = urlsplit(rest.partition(" ")[0]).hostname or ""
        is_loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, or none at all: the answer is the console's
        return ""
    return host if is_loopback else ""


def _is_paired(ask: Ask) -> bool:
    """Wait until a robot has used the code, or the code has ended. Says of robots that are refused meanwhile."""
    said, stored = "", STORED_LOOKS
    while True:
        found = read_answer(_DialIn, ask("GET", "/api/dial-in"))
        if found.key == "paired":
            typer.echo(f"lockstep: {escaped(found.robot)} is paired", err=True)
            return True
        if found.pairing.refused and found.pairing.refused != said:
            said = found.pairing.refused
            typer.echo(f"lockstep: a robot was refused: {escaped(said)}", err=True)
        stored -= found.pairing.state == "paired"  # a disk may take a while to take the key
        if found.pairing.state not in ("waiting", "paired") or stored < 0:
            typer.echo("lockstep: no robot was paired: the code has ended", err=True)
            return False
        time.sleep(LOOK_SECONDS)


def _print(answer: dict[str, Any], as_json: bool, words: str) -> None:
    sys.stdout.write((json.dumps(answer) if as_json else words) + "\n")
    sys.stdout.flush()
