"""`lockstep replay`: serves the player for one recording until it is ended. Apart, since it loads the web stack."""

import asyncio
import secrets
import sys
from pathlib import Path
from urllib.parse import quote

import msgspec
import typer

from lockstep.server.auth.tokens import Access
from lockstep.server.composition.replay_app import create_replay_app
from lockstep.server.http.transport.serve import PortTaken, bind, running, wait_for_signal
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.recording_store import recording_id
from lockstep.server.util.display_names import escaped

__all__ = ["serve_replay"]

EXIT_USAGE = 2
EXIT_PORT_TAKEN = 3
TOKEN_SECONDS = 30 * 86_400.0
TICKET_SECONDS = 600.0


def serve_replay(path: Path, host: str, port: int, as_json: bool) -> None:
    """Serve the player until the process is told to end.

    Raises:
        typer.Exit: the port is taken, or the file is no recording.
    """
    try:
        asyncio.run(_serve(path, host, port, as_json))
    except PortTaken as error:
        typer.echo(f"lockstep: {escaped(error)}; choose another with --port", err=True)
        raise typer.Exit(EXIT_PORT_TAKEN) from error
    except RecordingError as error:
        typer.echo(f"lockstep: {escaped(error)}", err=True)
        raise typer.Exit(EXIT_USAGE) from error


async def _serve(path: Path, host: str, port: int, as_json: bool) -> None:
    listener = bind(host, port)
    try:
        access = Access(secrets.token_urlsafe(32), token_seconds=TOKEN_SECONDS, ticket_seconds=TICKET_SECONDS)
        own_host, own_port = listener.getsockname()[:2]
        url = f"http://{f'[{own_host}]' if ':' in own_host else own_host}:{own_port}"
        told = recording_id(path)
        link = f"{url}/recordings#token={access.issue('observer', 'replay')}&recording={quote(told, safe='')}"
        app = create_replay_app(path, access, host)
        await asyncio.to_thread(app.state.recordings.library.entries)  # its index is known when the page asks for it
        async with running(app, listener):
            if as_json:
                said = {"console": url, "recording": told, "link": link}
                sys.stdout.write(msgspec.json.encode(said).decode() + "\n")
            else:
                sys.stdout.write(f"\n  To look at {escaped(path.name)}, open:   {link}\n\n")
            sys.stdout.flush()
            await wait_for_signal()
    finally:
        listener.close()
