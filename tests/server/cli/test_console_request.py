"""Whatever answers in place of a console, each command that asks it ends with one line that says so."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lockstep.server.cli.main import app

COMMANDS = (
    ("record", "start"),
    ("record", "stop"),
    ("record", "status"),
    ("record", "status", "--json"),
    ("pair",),
    ("pair", "--withdraw"),
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
def answering(answer: Any) -> Iterator[str]:
    """The URL of what answers each request with this JSON."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            body = json.dumps(answer).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_POST = do_DELETE = do_GET

        def log_message(self, format: str, *args: Any) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


def lockstep(state: Path, url: str, *words: str) -> Result:
    environment = {"LOCKSTEP_STATE_DIR": str(state), "LOCKSTEP_PUBLIC_URL": url}
    return CliRunner().invoke(app, words, env=environment)


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
