"""The command line, as real processes."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.core import TyperGroup
from typer.main import get_group
from typer.testing import CliRunner

from lockstep.server.cli.main import LOADERS, app
from tests.support.stack import running_fleet, running_stack
from tests.waiting import PATIENCE

LOCKSTEP = str(Path(sys.executable).with_name("lockstep"))


async def _run(*arguments: str) -> tuple[int, str, str]:
    """Exit code, output, errors of a command that ends by itself."""
    process = await asyncio.create_subprocess_exec(
        LOCKSTEP, *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        async with asyncio.timeout(PATIENCE):
            out, err = await process.communicate()
    except TimeoutError:
        process.kill()
        await process.wait()
        raise
    return process.returncode or 0, out.decode(), err.decode()


def _child_of(process: int) -> int:
    return int(Path(f"/proc/{process}/task/{process}/children").read_text().split()[0])


async def _is_back(http: httpx.AsyncClient, old_epoch: str) -> bool:
    session = (await http.get("/api/session")).json()
    return bool(session["link"]["up"] and session["epoch"] != old_epoch)


async def test_up_prints_one_line_that_works_and_leaves_nothing_running(tmp_path: Path) -> None:
    async with running_stack(tmp_path, extra=("--robot-port", "0")) as stack:
        token = stack.operator.partition("#token=")[2]
        assert stack.operator.startswith(stack.console)
        async with httpx.AsyncClient(base_url=stack.console, trust_env=False) as http:
            session = await http.get("/api/session", headers={"Authorization": f"Bearer {token}"})
            assert session.json()["link"]["up"] is True
            assert session.json()["you"]["role"] == "operator"
        assert await stack.events("start")
    assert not stack.running.output.unread, "nothing but the one line"
    assert stack.process.returncode == 0
    port = int(stack.robot.rpartition(":")[2])
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0


async def test_a_bridge_that_dies_is_started_again_on_the_same_port(tmp_path: Path) -> None:
    async with running_stack(tmp_path, extra=("--robot-port", "0")) as stack:
        token = stack.operator.partition("#token=")[2]
        headers = {"Authorization": f"Bearer {token}"}
        bridge = _child_of(stack.process.pid)
        async with httpx.AsyncClient(base_url=stack.console, trust_env=False, headers=headers) as http:
            before = (await http.get("/api/session")).json()["epoch"]
            os.kill(bridge, signal.SIGKILL)
            async with asyncio.timeout(PATIENCE):
                while not (await _is_back(http, before)):  # noqa: ASYNC110
                    await asyncio.sleep(0.1)
        await stack.says("the robot bridge ended (signal 9, Killed)")
        await stack.says(stack.robot)


@pytest.fixture
def hangups() -> Iterator[None]:
    """What is started hears of the end of its terminal, also where the tests themselves run under nohup."""
    before = signal.signal(signal.SIGHUP, lambda *_: None)  # a handler: a program that is started has the default again
    yield
    signal.signal(signal.SIGHUP, before)


async def test_the_end_of_the_terminal_ends_the_console_in_order(tmp_path: Path, hangups: None) -> None:
    async with running_stack(tmp_path) as stack:
        stack.process.send_signal(signal.SIGHUP)
        async with asyncio.timeout(PATIENCE):
            assert await stack.process.wait() == 0


async def test_a_console_that_crashes_in_native_code_says_where_it_was(tmp_path: Path) -> None:
    async with running_stack(tmp_path) as stack:
        os.kill(stack.process.pid, signal.SIGSEGV)
        async with asyncio.timeout(PATIENCE):
            assert await stack.process.wait() == -signal.SIGSEGV
        await stack.says("most recent call first")
        await stack.says("Segmentation fault")


async def test_a_port_in_use_is_said_clearly() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        code, out, err = await _run("serve", "--port", str(port))
    assert (code, out) == (3, "")
    assert f"cannot listen on 127.0.0.1:{port}" in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("up", "--robot", "teapot", "--port", "0", "--robot-port", "0"), 2, "teapot"),
        (("up", "--ros2", "none.yaml", "--port", "0", "--robot-port", "0"), 4, "none.yaml: No such file"),
        (("up", "--robot-python", "/none/python", "--port", "0", "--robot-port", "0"), 4, "/none/python"),
        (("serve", "--board", "redis://h", "--public-url", "http://h"), 2, "--robot NAME=tcp://"),
        (("serve", "--ice-host", "203.0.113.1"), 2, "the outer address of a one-to-one NAT with --advertise"),
    ],
)
async def test_what_cannot_work_is_said_in_one_line(arguments: tuple[str, ...], code: int, words: str) -> None:
    result, out, err = await _run(*arguments)
    assert (result, out) == (code, "")
    assert words in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robot", "nonsense"), "is not tcp://host:port"),
        (("--ice-host", "example"), "ice_hosts"),
        (("--advertise", "example"), "advertise"),
        (("--port", "70000"), "65535"),
        (("--board", "redis://:a-password@h:port"), "board: Value error, the board is not redis://"),
    ],
)
def test_what_no_setting_can_be_is_said_before_anything_is_started(arguments: tuple[str, ...], words: str) -> None:
    asked = CliRunner().invoke(app, ["serve", *arguments])
    assert (asked.exit_code, asked.stdout) == (2, "")
    assert words in asked.stderr
    assert "Traceback" not in asked.stderr
    assert "a-password" not in asked.stderr


async def test_a_certificate_that_is_none_is_said_in_one_line(tmp_path: Path) -> None:
    garbage = tmp_path / "garbage.pem"
    garbage.write_text("garbage")
    code, out, err = await _run("serve", "--port", "0", "--tls-cert", str(garbage), "--tls-key", str(garbage))
    assert (code, out) == (2, "")
    assert "tls_cert and tls_key are not a certificate chain" in err
    assert "Traceback" not in err


async def test_a_place_that_takes_no_certificate_of_our_own_is_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "tls-key.new").mkdir()
    code, out, err = await _run("serve", "--port", "0", "--tls", "self-signed", "--state-dir", str(tmp_path))
    assert (code, out) == (2, "")
    assert "the state directory cannot be used" in err
    assert "Traceback" not in err


async def test_without_a_state_directory_the_console_of_one_run_has_a_certificate_too(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    process = await asyncio.create_subprocess_exec(
        *(LOCKSTEP, "serve", "--port", "0", "--tls", "self-signed", "--state-dir", str(tmp_path / "file" / "state")),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        assert process.stderr is not None
        async with asyncio.timeout(PATIENCE):
            while "waiting for the robot" not in (line := (await process.stderr.readline()).decode()):
                assert line, "the console has ended"
    finally:
        if process.returncode is None:
            process.terminate()
        await process.communicate()


async def test_up_runs_several_robots_each_with_a_name_and_ends_them_all(tmp_path: Path) -> None:
    async with running_fleet(tmp_path, {"left": "planar", "right": "planar"}) as fleet:
        assert set(fleet.robots) == {"left", "right"}
        async with httpx.AsyncClient(base_url=fleet.console, trust_env=False) as http:
            token = fleet.operator.partition("#token=")[2]
            robots = (await http.get("/api/fleet", headers={"Authorization": f"Bearer {token}"})).json()["robots"]
        assert [(each["name"], each["link"]) for each in robots] == [("left", "up"), ("right", "up")]
        assert all([await fleet.events("start", name) for name in fleet.robots])
    assert fleet.process.returncode == 0
    for address in fleet.robots.values():
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.1", int(address.rpartition(":")[2]))) != 0


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("serve", "--robot", "A=tcp://127.0.0.1:1"), "bad_robot_name"),
        (("serve", "--robot", "a=tcp://127.0.0.1:1", "--robot", "a=tcp://127.0.0.1:2"), "robot_named_twice"),
        (("serve", "--robot", "a=tcp://127.0.0.1:1", "--robot", "tcp://127.0.0.1:2"), "robot_without_name"),
        (("up", "--robot", "a=planar", "--robot", "a=planar"), "robot_named_twice"),
    ],
)
def test_robots_that_cannot_be_meant_are_refused_by_name(arguments: tuple[str, ...], name: str) -> None:
    asked = CliRunner().invoke(app, arguments)
    assert (asked.exit_code, name in asked.stderr) == (2, True)


@pytest.mark.parametrize(
    ("robots", "places"),
    [
        ((), ["mobile-manipulator"]),
        (("--robot", "planar"), ["planar"]),
        (("--robot", "planar", "--robot", "left=planar"), ["planar", "left"]),
        (("--ros2", "robots/crane.yaml"), ["crane"]),
        (("--mjcf", "arm.xml"), ["arm"]),
    ],
)
def test_each_robot_of_up_has_its_latch_by_its_name_whatever_the_port(
    robots: tuple[str, ...], places: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[list[str]] = []
    monkeypatch.setattr(
        "lockstep.server.cli.console.consoles.BridgeProcess",
        lambda kind, host, port, options, *more: given.append(options),
    )
    monkeypatch.setattr("lockstep.server.cli.console.consoles._run", lambda *more: None)
    for port in ("8000", "9000"):
        asked = CliRunner().invoke(app, ["up", *robots, "--port", port, "--state-dir", str(tmp_path)])
        assert asked.exit_code == 0, asked.output
    found = [options[options.index("--state-dir") + 1] for options in given]
    assert found == [str(tmp_path / "stops" / each) for each in places] * 2


@pytest.mark.parametrize("robots", [["tractor"], ["left=planar", "right=tractor"]])
def test_up_names_the_robots_there_are_when_one_is_unknown(robots: list[str]) -> None:
    asked = CliRunner().invoke(app, ["up", *(word for robot in robots for word in ("--robot", robot))])
    assert asked.exit_code == 2
    assert "no robot 'tractor'; there are" in asked.stderr


def test_the_version_is_that_of_the_distribution() -> None:
    asked = CliRunner().invoke(app, ["--version"])
    assert (asked.exit_code, asked.stdout.split()) == (0, ["lockstep", version("lockstep-console")])


def test_help_begins_with_what_a_newcomer_needs_and_puts_measuring_apart() -> None:
    said = CliRunner().invoke(app, ["--help"], terminal_width=100).stdout
    places = [said.index(f" {name} ") for name in ("up", "serve", "invite", "record", "experiment", "soak")]
    assert places == sorted(places)
    assert said.index("Measure and try") < said.index(" experiment ")


async def test_a_misspelt_setting_of_the_environment_is_named_at_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOCKSTEP_PORTT", "1")
    async with running_stack(tmp_path, extra=("--robot-port", "0")) as stack:
        pass
    assert any("LOCKSTEP_PORTT is not a setting" in line for line in stack.output)


def test_each_command_is_where_it_is_looked_for_and_help_names_them_all() -> None:
    said = CliRunner().invoke(app, ["--help"], terminal_width=100).stdout
    for load, names in LOADERS.items():
        commands = get_group(load()).commands
        assert set(commands) == set(names)
        assert all(f" {name} " in said for name in names)


@pytest.mark.parametrize("arguments", [("--version",), ("robot", "--help"), ("invite", "--help")])
def test_a_command_that_runs_no_console_loads_nothing_of_media_and_the_web(arguments: tuple[str, ...]) -> None:
    heavy = "{'aiortc', 'av', 'fastapi', 'uvicorn', 'viser'}"
    look = f"import sys, atexit; atexit.register(lambda: print('loaded', sorted({heavy} & set(sys.modules)))); "
    program = (sys.executable, "-c", look + "from lockstep.server.cli.main import main; main()", *arguments)
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "loaded []"


def _commands(group: TyperGroup, *before: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup) and not command.params:
            yield from _commands(command, *before, name)
        else:
            yield (*before, name), command


COMMANDS = dict(each for load in LOADERS for each in _commands(get_group(load())))


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_shows_the_text_of_each_option_in_full(words: tuple[str, ...]) -> None:
    """Text in square brackets is markup to rich, which leaves it out unless it is escaped."""
    said = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "2000"}).stdout
    texts = [text for each in COMMANDS[words].params if (text := getattr(each, "help", None))]
    for text in texts:
        assert " ".join(text.replace("\\[", "[").split()) in said
