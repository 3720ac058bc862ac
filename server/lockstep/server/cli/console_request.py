"""Requests of the command line to a running console: that of the state directory, or of a supervisor's link."""

import secrets
import ssl
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import parse_qs, urlsplit

import msgspec
import typer

from lockstep.server.auth.tokens import Identity
from lockstep.server.cli.console_address import read_address
from lockstep.server.http.robot_paths import ROBOTS
from lockstep.server.http.transport.tls import trusting
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state
from lockstep.server.util.display_names import escaped
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = ["ask_by_link", "ask_console", "read_answer"]

EXIT_USAGE = 2
HTTP_SECONDS = 30.0
TOKEN_SECONDS = 300.0  # that a request's token is good for; the clock that the two share is written once a minute

Answer = TypeVar("Answer", bound=msgspec.Struct)


def ask_console(
    settings: Settings, robot: str, method: str, path: str, body: dict[str, str] | None = None
) -> dict[str, Any]:
    """Return the answer of this state directory's console, as a supervisor.

    It is asked at its listener on this machine, whatever the console's name leads to, and must show the certificate
    that it wrote down if it encrypts.

    Args:
        robot: of a fleet; "" for the only robot of a console
        path: "/api/recordings"
        body: sent as JSON

    Raises:
        typer.Exit: the console does not run, or refused; it has been said why.
    """
    try:
        state = open_state(settings)
    except StateDirUnusable as error:
        raise _usage(str(error)) from error
    console = read_address(state.directory)
    if not console.local:
        was = f"the console at {console.url} does not run any more, or is older than this command: start it again"
        raise _usage(was if console.url else "no console has run with this state directory")
    if settings.public_url and settings.public_url != console.url:
        raise _usage(
            f"the console that started last with this state directory is at {console.url}, not at {settings.public_url}"
        )
    try:
        verify: ssl.SSLContext | bool = trusting(console.certificate) if console.certificate else True
    except ValueError as error:
        raise _usage(f"what the console wrote down of itself is {error}") from error
    now = state.invitations.clock.now()
    token = state.access.sign(Identity("supervisor", "command line", secrets.token_hex(8), now + TOKEN_SECONDS), now)
    base = f"{console.local}{ROBOTS}/{robot}" if robot else console.local
    outer = urlsplit(console.url).netloc  # by which the answer names the console
    return _ask(base, token, verify, method, path, body, host=outer)


def ask_by_link(link: str, tls_ca: Path | None, robot: str, method: str, path: str) -> dict[str, Any]:
    """Return the answer of the console that `link` opens, "https://host:port/#token=…", with the link's own rights.

    `tls_ca`: a file with a certificate to trust instead of the system's.

    Raises:
        typer.Exit: it is no such link, or the console does not answer, or refused; it has been said why.
    """
    try:
        parts = urlsplit(link)
        token = parse_qs(parts.fragment).get("token", [""])[0]
        is_link = parts.scheme in ("http", "https") and parts.hostname and token.isascii()
    except ValueError:
        is_link, token = False, ""
    if not is_link or not token:
        raise _usage("a link is https://host:port/#token=…, as `lockstep invite --role supervisor` prints it")
    base = f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}"
    try:
        verify: ssl.SSLContext | bool = True if tls_ca is None else ssl.create_default_context(cafile=str(tls_ca))
    except (OSError, ssl.SSLError) as error:
        raise _usage(f"{tls_ca} is no certificate: {error}") from error
    return _ask(f"{base}{ROBOTS}/{robot}" if robot else base, token, verify, method, path, None)


def read_answer(kind: type[Answer], answer: dict[str, Any]) -> Answer:
    """Return the fields of an answer: every command reads answers by this, and indexes none.

    Raises:
        typer.Exit: it is not the answer of a console; it has been said why.
    """
    try:
        return msgspec.convert(answer, kind)
    except msgspec.ValidationError as error:
        raise _usage(f"the answer is not one of a console: {error}") from error


def _ask(
    base: str,
    token: str,
    verify: ssl.SSLContext | bool,
    method: str,
    path: str,
    body: dict[str, str] | None,
    host: str = "",
) -> dict[str, Any]:
    import httpx

    headers = {"Authorization": f"Bearer {token}", **({"Host": host} if host else {})}
    try:
        with httpx.Client(verify=verify, trust_env=False, timeout=HTTP_SECONDS) as http:
            answer = http.request(method, f"{base}{path}", headers=headers, json=body)
    except (httpx.HTTPError, httpx.InvalidURL, UnicodeError) as error:
        raise _usage(f"the console at {base} does not answer: {error}") from error
    try:
        found = answer.json()
    except (ValueError, RecursionError) as error:  # also of numbers that are too long, and of JSON that is too deep
        raise _usage(f"{base} is no console: it answers {answer.status_code}") from error
    if not isinstance(found, dict):
        raise _usage(f"{base} is no console: it answers {answer.status_code}")
    if answer.is_error:
        raise _usage(f"{found.get('error')}: {found.get('detail')}")
    return found


def _usage(text: str) -> typer.Exit:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
    return typer.Exit(EXIT_USAGE)
