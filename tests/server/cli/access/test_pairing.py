"""`lockstep pair` and `lockstep forget` as their users run them, beside a console and from elsewhere."""

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.server.cli.access import pairing as pairing_commands
from lockstep.server.cli.main import app
from tests.server.cli.test_console_request import answering, lockstep
from tests.support.stack import Stack, running_console, running_stack
from tests.waiting import PATIENCE

TLS = ("--tls", "self-signed", "--host", "127.0.0.1")
PIPE = asyncio.subprocess.PIPE


async def run(*arguments: str) -> tuple[int | None, str, str]:
    """Exit code, output and errors."""
    process = await asyncio.create_subprocess_exec(LOCKSTEP, *arguments, stdout=PIPE, stderr=PIPE)
    async with asyncio.timeout(PATIENCE):
        output, errors = await process.communicate()
    return process.returncode, output.decode(), errors.decode()


def robot_command(stack: Stack, directory: Path, code: str) -> tuple[str, ...]:
    url = stack.console.replace("http", "ws", 1)
    command = (sys.executable, "-m", "lockstep.robot_bridge", "planar", "--json", "--console", url)
    return (*command, "--state-dir", str(directory / "robot"), "--pair", code)


async def test_a_robot_is_paired_and_forgotten_from_beside_the_console(tmp_path: Path) -> None:
    async with running_console(tmp_path, "dial-in", tmp_path / "events", TLS) as stack:
        beside = ("--state-dir", str(tmp_path / "state"))
        waiting = await asyncio.create_subprocess_exec(
            *(LOCKSTEP, "pair", "--wait", "--json", *beside), stdout=PIPE, stderr=PIPE
        )
        assert waiting.stdout is not None
        async with asyncio.timeout(PATIENCE):
            made = json.loads(await waiting.stdout.readline())
        assert made["command"].endswith(f"--pair {made['code']}")
        async with running_process(*robot_command(stack, tmp_path, made["code"])):
            async with asyncio.timeout(PATIENCE):
                _, errors = await waiting.communicate()
            assert waiting.returncode == 0
            assert b"is paired" in errors
            code, _, errors_again = await run("pair", *beside)
            assert (code, "already_paired" in errors_again) == (2, True)
            assert await run("forget", *beside) == (0, "the robot is forgotten\n", "")
        code, _, said = await run("forget", *beside)
        assert (code, "no robot is paired" in said) == (2, True)


@pytest.mark.parametrize("outer", ["--public-url", "--advertise"])
async def test_beside_the_console_its_address_for_others_need_not_lead_anywhere(tmp_path: Path, outer: str) -> None:
    """As with a proxy, or a router, that this machine does not get through from inside."""
    name = "https://console.example.org" if outer == "--public-url" else "203.0.113.7"
    options = ("--tls", "self-signed", "--host", "0.0.0.0", outer, name)
    async with running_console(tmp_path, "dial-in", tmp_path / "events", options):
        code, output, errors = await run("pair", "--state-dir", str(tmp_path / "state"))
    assert code == 0, errors
    assert output.startswith(f"lockstep robot NAME --console wss://{name.removeprefix('https://')}")
    assert "warning" not in errors


async def test_a_supervisors_link_does_the_same_from_elsewhere_and_an_operators_does_not(tmp_path: Path) -> None:
    async with running_console(tmp_path, "dial-in", tmp_path / "events", TLS) as stack:
        trusted = ("--tls-ca", str(tmp_path / "state" / "tls-cert.pem"))
        code, output, errors = await run("pair", "--link", stack.supervisor, *trusted)
        assert code == 0, errors
        assert output.startswith("lockstep robot NAME --console wss://127.0.0.1:")
        assert "5 tries" in errors
        assert "warning: 127.0.0.1 in this command is the robot's own computer" in errors
        assert "--public-url (LOCKSTEP_PUBLIC_URL)" in errors
        code, _, errors = await run("pair", "--link", stack.operator, *trusted)
        assert (code, "lockstep: " in errors) == (2, True)
        code, output, _ = await run("pair", "--withdraw", "--link", stack.supervisor, *trusted)
        assert (code, output) == (0, "the code is withdrawn\n")
        code, _, errors = await run("pair", "--link", stack.supervisor)
        assert (code, "does not answer" in errors) == (2, True), "its certificate is nobody's"


@pytest.mark.parametrize(
    ("command", "warned"),
    [
        ("lockstep robot NAME --console wss://127.0.0.1:8000 --pair K", True),
        ("lockstep robot NAME --console wss://127.8.8.8/robots/left --pair K", True),
        ("lockstep robot NAME --console ws://[::1]:8000 --pair K", True),
        ("lockstep robot NAME --console wss://localhost --pair K", True),
        ("lockstep robot NAME --console wss://192.0.2.7:8000 --pair K", False),
        ("lockstep robot NAME --console wss://localhost.example.org --pair K", False),
        ("lockstep robot NAME --console wss://[::1 --pair K", False),
        ("lockstep robot NAME --console", False),
        ("lockstep robot", False),
    ],
)
def test_a_command_that_works_on_this_machine_alone_comes_with_a_warning(
    tmp_path: Path, command: str, warned: bool
) -> None:
    with answering({"command": command, "seconds": 60, "tries": 5}) as local:
        done = lockstep(tmp_path, local, "pair")
        as_json = lockstep(tmp_path, local, "pair", "--json")
    assert (done.exit_code, done.stdout) == (0, f"{command}\n")
    assert ("warning: " in done.stderr) is warned
    assert json.loads(as_json.stdout)["command"] == command
    assert ("warning: " in as_json.stderr) is warned


WAITS = [
    {"address": "10.0.0.7", "since": 1.0, "name": "", "why": "robot_unknown"},
    {"address": "10.0.0.8", "since": 2.0, "name": "pla\x1b[2Jnar", "why": "wrong_code"},
]
WAIT_LINES = "waits: a robot at 10.0.0.7: robot_unknown\nwaits: pla\\x1b[2Jnar at 10.0.0.8: wrong_code\n"


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ({"state": "unpaired", "key": ""}, "no robot is paired\n"),
        ({"state": "unpaired", "key": "", "waits": WAITS}, f"no robot is paired\n{WAIT_LINES}"),
        (
            {"state": "connected", "key": "paired", "robot": "planar", "address": "10.0.0.9", "waits": WAITS},
            f"planar is connected from 10.0.0.9\n{WAIT_LINES}",
        ),
        ({"state": "away", "key": "settings"}, "the robot is away\n"),
        ({"state": "connected", "key": "", "dials_in": False}, "the console connects to this robot"),
    ],
)
def test_the_status_names_the_robot_and_those_that_wait(tmp_path: Path, answer: dict[str, Any], said: str) -> None:
    with answering({"pairing": {"state": "none"}} | answer) as local:
        done = lockstep(tmp_path, local, "pair", "--status")
        as_json = lockstep(tmp_path, local, "pair", "--status", "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.startswith(said)
    assert json.loads(as_json.stdout)["state"] == answer["state"]


async def test_waiting_ends_when_the_code_does(tmp_path: Path) -> None:
    async with running_console(tmp_path, "dial-in", tmp_path / "events", TLS):
        beside = ("--state-dir", str(tmp_path / "state"))
        waiting = await asyncio.create_subprocess_exec(*(LOCKSTEP, "pair", "--wait", *beside), stdout=PIPE, stderr=PIPE)
        assert waiting.stdout is not None
        async with asyncio.timeout(PATIENCE):
            assert (await waiting.stdout.readline()).startswith(b"lockstep robot")
            assert (await run("pair", "--withdraw", *beside))[0] == 0
            _, errors = await waiting.communicate()
        assert waiting.returncode == 1
        assert b"no robot was paired" in errors


async def test_a_console_that_connects_to_its_robot_pairs_none(tmp_path: Path) -> None:
    async with running_stack(tmp_path):
        code, _, errors = await run("pair", "--state-dir", str(tmp_path / "state"))
    assert (code, "not_dial_in" in errors) == (2, True)


@pytest.mark.parametrize("link", ["hello", "ftp://x/#token=1", "http://127.0.0.1:1/", "http://[/#token=1"])
async def test_what_is_no_link_is_refused_before_anything_is_asked(link: str) -> None:
    code, _, errors = await run("forget", "--link", link)
    assert (code, "a link is https://" in errors) == (2, True)


async def test_a_console_that_is_away_is_said_to_be(tmp_path: Path) -> None:
    code, _, errors = await run("forget", "--state-dir", str(tmp_path))
    assert (code, "no console has run" in errors) == (2, True)
    code, _, errors = await run("forget", "--link", "http://127.0.0.1:1/#token=x")
    assert (code, "does not answer" in errors) == (2, True)
    code, _, errors = await run("forget", "--link", "http://127.0.0.1:1/#token=x", "--tls-ca", str(tmp_path / "none"))
    assert (code, "is no certificate" in errors) == (2, True)


ODD = [
    '{"command": "lockstep robot"}',
    '{"command": 3, "seconds": 60, "tries": 5}',
    '{"command": "lockstep robot", "seconds": "soon", "tries": 5}',
    "[]",
    "nothing",
    '{"seconds": ' + "9" * 5000 + "}",
    "[" * 100_000,
]
CODE = '{"command": "lockstep robot NAME", "seconds": 60, "tries": 5}'
ODD_STATES = [
    '{"key": ""}',
    '{"key": "", "pairing": null}',
    '{"key": "", "pairing": {"state": 1, "refused": ""}}',
    "{}",
]


@pytest.mark.parametrize(("code", "state"), [*((odd, "{}") for odd in ODD), *((CODE, odd) for odd in ODD_STATES)])
async def test_an_answer_that_is_none_of_a_console_is_said_to_be_and_is_no_fault(code: str, state: str) -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked = await reader.readuntil(b"\r\n\r\n")
        body = (code if asked.startswith(b"POST") else state).encode()
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\nConnection: close\r\n\r\n" % len(body) + body)
        writer.close()
        await writer.wait_closed()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        status, _, errors = await run("pair", "--wait", "--link", f"http://127.0.0.1:{port}/#token=x")
    assert status == 2, errors
    assert "Traceback" not in errors
    assert "console" in errors


def pairing(state: str, key: str = "") -> dict[str, Any]:
    return {"key": key, "robot": "desk", "pairing": {"state": state}}


@pytest.mark.parametrize(
    ("answers", "code"),
    [
        ([pairing("waiting"), pairing("paired"), pairing("paired"), pairing("paired", "paired")], 0),
        ([pairing("waiting"), pairing("expired")], 1),
        ([pairing("paired")] * 4, 1),
    ],
)
def test_who_waits_for_a_robot_waits_until_its_key_is_stored(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, answers: list[dict[str, Any]], code: int
) -> None:
    """A robot has used the code; the console's disk takes the key a while later, or never."""
    given = iter([{"command": "lockstep robot", "seconds": 600.0, "tries": 5}, *answers])
    monkeypatch.setattr(pairing_commands, "ask_console", lambda *_: next(given))
    monkeypatch.setattr(pairing_commands, "LOOK_SECONDS", 0.0)
    monkeypatch.setattr(pairing_commands, "STORED_LOOKS", 3)
    done = CliRunner().invoke(app, ["pair", "--wait", "--state-dir", str(tmp_path)])
    assert done.exit_code == code, done.output
    assert ("desk is paired" in done.stderr) == (code == 0)
