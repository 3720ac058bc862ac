"""A command asks the console of its state directory, and nobody else; whatever answers there is said in one line."""

import datetime
import json
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lockstep.server.cli.console_address import ConsoleAddress, forget_listener, read_address, write_address
from lockstep.server.cli.main import app
from lockstep.server.http.transport.tls import Certificate, self_signed, shown_by
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state

COMMANDS = (
    ("record", "start"),
    ("record", "stop"),
    ("record", "status"),
    ("record", "status", "--json"),
    ("pair",),
    ("pair", "--withdraw"),
    ("pair", "--status"),
    ("forget",),
)
ANSWERS: tuple[Any, ...] = (
    {},
    {"state": None},
    {"state": {}},
    {"state": {"state": "paused"}},
    {"state": "recording", "bytes": "many"},
    {"key": "paired", "pairing": []},
    {"command": 1, "seconds": None, "tries": 0},
    [],
    "x",
)


@contextmanager
def answering(
    answer: Any, asked: list[Message] | None = None, tls: Certificate | None = None, host: str = "127.0.0.1"
) -> Iterator[str]:
    """The URL of what answers each request with this JSON. `asked`: gets the headers of each request."""
    received = [] if asked is None else asked

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            received.append(self.headers)
            body = json.dumps(answer).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_DELETE = do_GET

        def log_message(self, format: str, *args: Any) -> None: ...

    class Server(ThreadingHTTPServer):
        address_family = socket.AF_INET6 if ":" in host else socket.AF_INET

        def server_bind(self) -> None:  # the base class looks up a name, which may take long
            self.socket.bind(bind_to)
            self.server_name, self.server_port = host, self.socket.getsockname()[1]

    bind_to = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0][4]
    with Server((host, 0), Handler) as server:
        if tls is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(tls.chain, tls.key)
            server.socket = context.wrap_socket(server.socket, server_side=True)
        thread = Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            shown = f"[{host}]" if ":" in host else host
            yield f"{'http' if tls is None else 'https'}://{shown}:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


def lockstep(state: Path, local: str, *words: str, url: str = "", certificate: str = "", public: str = "") -> Result:
    """Run a command beside a console that has written these addresses down."""
    (state / "console.json").write_text(json.dumps({"url": url, "local": local, "certificate": certificate}))
    environment = {"LOCKSTEP_STATE_DIR": str(state), "LOCKSTEP_PUBLIC_URL": public}
    return CliRunner().invoke(app, words, env=environment)


def certificate(directory: Path) -> Certificate:
    return self_signed(directory, {"localhost"}, datetime.datetime.now(datetime.UTC))


@pytest.mark.parametrize("answer", ANSWERS, ids=json.dumps)
def test_an_answer_of_another_shape_is_named(tmp_path: Path, answer: Any) -> None:
    with answering(answer) as url:
        for command in COMMANDS:
            done = lockstep(tmp_path, url, *command)
            assert done.exit_code == 2, (command, done.output, done.exception)
            assert "is not one of a console" in done.stderr or "is no console" in done.stderr, command
            assert done.stderr.count("\n") == 1
            assert done.stdout == ""


def test_an_answer_of_the_shape_is_said_in_words(tmp_path: Path) -> None:
    with answering({"state": {"state": "recording", "recording": "r\x1b[2J", "bytes": 2_000_000}}) as url:
        assert lockstep(tmp_path, url, "record", "status").stdout == "recording r[2J, 2.0 MB\n"


RECORDING: Any = {"state": {"state": "recording", "recording": "r", "bytes": 1}}


@pytest.mark.parametrize("where", ["url", "public"])
def test_nobody_at_the_address_for_others_is_asked(tmp_path: Path, where: str) -> None:
    """It may lead to another machine, which would get the token of a supervisor."""
    asked: list[Message] = []
    outside: list[Message] = []
    with answering(RECORDING, asked) as local, answering(RECORDING, outside) as others:
        done = lockstep(tmp_path, local, "record", "status", url=others, public=others if where == "public" else "")
    assert done.exit_code == 0, done.output
    assert outside == []
    (headers,) = asked
    assert headers["Host"] == others.removeprefix("http://"), "by which the console's answer names it"


def test_the_token_of_a_request_is_good_for_minutes(tmp_path: Path) -> None:
    asked: list[Message] = []
    with answering(RECORDING, asked) as local:
        assert lockstep(tmp_path, local, "record", "status").exit_code == 0
    state = open_state(Settings(state_dir=tmp_path))
    holder = state.access.verify(asked[0]["Authorization"].removeprefix("Bearer "))
    assert 0.0 < holder.expires - state.invitations.clock.now() <= 300.0


def test_a_console_that_is_not_the_one_that_was_named_is_not_asked(tmp_path: Path) -> None:
    asked: list[Message] = []
    with answering(RECORDING, asked) as local:
        done = lockstep(tmp_path, local, "record", "start", url="http://second:1", public="http://first:1")
    assert (done.exit_code, asked) == (2, [])
    assert "at http://second:1, not at http://first:1" in done.stderr


def test_a_certificate_counts_after_its_end(tmp_path: Path) -> None:
    """A console may run for longer; what it is known by is the certificate and not its dates."""
    old = self_signed(tmp_path / "own", {"localhost"}, datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC))
    with answering(RECORDING, tls=old) as local:
        done = lockstep(tmp_path, local, "record", "status", certificate=shown_by(old))
    assert done.exit_code == 0, done.output


def test_a_console_that_ends_forgets_its_listener_and_not_that_of_another(tmp_path: Path) -> None:
    directory = open_state(Settings(state_dir=tmp_path)).directory
    first, second = (
        ConsoleAddress("http://a:1", "http://127.0.0.1:1"),
        ConsoleAddress("http://b:2", "http://127.0.0.1:2"),
    )
    write_address(directory, first)
    write_address(directory, second)
    forget_listener(directory, first)
    assert read_address(directory) == second
    forget_listener(directory, second)
    assert read_address(directory) == ConsoleAddress("http://b:2")


def test_a_console_is_known_by_its_certificate_whatever_its_name(tmp_path: Path) -> None:
    own = certificate(tmp_path / "own")
    with answering(RECORDING, tls=own) as local:
        done = lockstep(tmp_path, local, "record", "status", certificate=shown_by(own))
    assert done.exit_code == 0, done.output


def test_another_certificate_at_its_place_gets_no_token(tmp_path: Path) -> None:
    own, other = certificate(tmp_path / "own"), certificate(tmp_path / "other")
    asked: list[Message] = []
    with answering(RECORDING, asked, tls=other) as local:
        done = lockstep(tmp_path, local, "record", "status", certificate=shown_by(own))
    assert (done.exit_code, asked) == (2, [])
    assert "does not answer" in done.stderr


@pytest.mark.parametrize(
    "written", ["", "{", '{"url": "http://127.0.0.1:1"}', '{"local": "http://127.0.0.1:1", "certificate": "x"}']
)
def test_without_an_address_that_can_be_trusted_nothing_is_asked(tmp_path: Path, written: str) -> None:
    (tmp_path / "console.json").write_text(written)
    done = CliRunner().invoke(app, ["record", "status"], env={"LOCKSTEP_STATE_DIR": str(tmp_path)})
    assert done.exit_code == 2
    assert any(why in done.stderr for why in ("no console has run", "older than this command", "no certificate"))
    assert done.stderr.count("\n") == 1
