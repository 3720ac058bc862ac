"""`lockstep check`: plays the cases of the protocol against a bridge."""

import asyncio
import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from lockstep.protocol.errors import LinkLost, SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.conformance.case import Outcome, Result
from lockstep.robot_bridge.conformance.errors import NotReady
from lockstep.robot_bridge.conformance.place import BadAddress, Place, parse_address
from lockstep.robot_bridge.conformance.run import CASES, play_all
from lockstep.robot_bridge.conformance.subject import FRACTION, Subject
from lockstep.robot_bridge.link.link_tls import LinkTls

__all__ = ["check"]

SECRET_VARIABLE = "LOCKSTEP_LINK_SECRET"
EXIT_FAILED = 1
EXIT_USAGE = 2
WORDS = {Outcome.OK: "ok", Outcome.FAILED: "FAILED"}  # the other outcomes are printed by their value
WIDTH = max(len(case.name) for case in CASES)


def check(
    address: Annotated[str, typer.Argument(help="The bridge: tcp://host:port or tls://host:port.")],
    link_secret_file: Annotated[
        Path | None,
        typer.Option(
            envvar="LOCKSTEP_LINK_SECRET_FILE",
            help="File with the secret of the robot link; or set LOCKSTEP_LINK_SECRET.",
        ),
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
    fraction: Annotated[
        float, typer.Option(min=0.001, max=1.0, help="Size of each motion, as a share of the axis' limit.")
    ] = FRACTION,
    case: Annotated[list[str] | None, typer.Option(help="Run only this case; repeat for several.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Move the robot without asking first.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as one JSON object.")] = False,
) -> None:
    """Check whether a robot bridge, in any language, does what docs/robot-link.md asks. IT MOVES THE ROBOT."""
    if unknown := sorted(set(case or ()) - {each.name for each in CASES}):
        raise _usage(f"no case {unknown[0]!r}; there are {', '.join(each.name for each in CASES)}")
    try:
        host, port, uses_tls = parse_address(address)
        tls = LinkTls(certificate=link_tls_cert, key=link_tls_key, authority=link_tls_ca).client_context()
        place = Place(host, port, _secret(link_secret_file), tls if uses_tls else None)
    except (BadAddress, SecretError) as error:
        raise _usage(error.detail if isinstance(error, SecretError) else str(error)) from error
    if not yes:
        _ask(address, fraction)
    wanted = [each for each in CASES if not case or each.name in case]
    try:
        results = asyncio.run(play_all(Subject(place, fraction), wanted, _nothing if as_json else _say))
    except (NotReady, LinkLost) as error:
        typer.echo(f"lockstep check: {error.detail if isinstance(error, LinkLost) else error}", err=True)
        raise typer.Exit(EXIT_FAILED) from error
    passed = all(result.outcome in (Outcome.OK, Outcome.NOT_APPLICABLE) for result in results)
    typer.echo(_as_json(address, results, passed) if as_json else _summary(results))
    if not passed:
        raise typer.Exit(EXIT_FAILED)


def _ask(address: str, fraction: float) -> None:
    """Ask whether the robot may move.

    Raises:
        typer.Exit: the answer is not yes.
    """
    typer.echo(
        f"This MOVES the robot at {address}: the first axis that is driven by a rate, and the first goal axis, to and\n"
        f"fro, by {fraction:.0%} of the limit. It begins the first action that moves the robot and asks nothing, such\n"
        "as home or dock, presses STOP and releases it. Nobody may stand where the robot reaches.",
        err=True,
    )
    if not sys.stdin.isatty():
        raise _usage("there is no terminal to ask on: give --yes if the robot may move")
    if not typer.confirm("May it move?", err=True):
        raise typer.Exit(EXIT_FAILED)


def _secret(path: Path | None) -> LinkSecret | None:
    if path is not None:
        return LinkSecret.read(path)
    text = os.environ.get(SECRET_VARIABLE, "")
    return LinkSecret(text) if text else None


def _say(result: Result) -> None:
    case, word = result.case, WORDS.get(result.outcome, str(result.outcome))
    typer.echo(f"{word:<14}  {case.name:<{WIDTH}}  {case.asks} (docs/robot-link.md, {case.section})")
    if result.detail:
        typer.echo(f"{'':<14}  {'':<{WIDTH}}  {result.detail}")


def _nothing(result: Result) -> None:
    """Print nothing: with --json everything is printed at the end."""


def _summary(results: list[Result]) -> str:
    counts = {outcome: sum(result.outcome is outcome for result in results) for outcome in Outcome}
    return ", ".join(f"{count} {outcome}" for outcome, count in counts.items() if count)


def _as_json(address: str, results: list[Result], passed: bool) -> str:
    cases = [
        {
            "name": result.case.name,
            "result": str(result.outcome),
            "asks": result.case.asks,
            "section": result.case.section,
            "detail": result.detail,
        }
        for result in results
    ]
    return json.dumps({"robot": address, "passed": passed, "cases": cases})


def _usage(text: str) -> typer.Exit:
    typer.echo(f"lockstep check: {text}", err=True)
    return typer.Exit(EXIT_USAGE)
