import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import Feedback, Stop, StopTaken
from lockstep.robot_bridge import cli
from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.stop.stop_latch import StopRecord
from lockstep.robot_bridge.stop.stop_store import Kept, StopStore
from tests.support.certificates import Authority


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
async def test_it_prints_its_address_once_ready_and_leaves_cleanly(how: signal.Signals, tmp_path: Path) -> None:
    log = tmp_path / "events.jsonl"
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--port", "0", "--json", "--event-log", str(log)),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(20):
            line = json.loads(await process.stdout.readline())
        host, _, port = line["robot"].removeprefix("tcp://").rpartition(":")
        async with RobotLink(host, int(port), "events") as link:
            await anext(link)
        process.send_signal(how)
        async with asyncio.timeout(20):
            out, err = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode == 0, err.decode()
    assert out == b""
    assert b"Traceback" not in err
    assert json.loads(log.read_text().splitlines()[0])["kind"] == "start"


async def test_what_is_printed_after_the_address_holds_up_nothing_when_nobody_reads_it() -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--port", "0", "--json"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(20):
            await process.stdout.readline()
            assert await process.stdout.read() == b""  # its end: what follows goes to the log
        assert process.returncode is None
    finally:
        process.terminate()
        await process.wait()


@asynccontextmanager
async def planar_bridge(*options: str) -> AsyncIterator[tuple[str, int]]:
    """`lockstep robot planar` on any free port, and its address."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--port", "0", "--json", *options),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(20):
            line = json.loads(await process.stdout.readline())
        yield "127.0.0.1", int(line["robot"].rpartition(":")[2])
    finally:
        process.terminate()
        await process.wait()


async def test_the_same_robot_on_any_free_port_has_the_same_latch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    async with planar_bridge() as address, RobotLink(*address, "operator") as link:
        link.send(Stop(press="ab" * 16, reason="smoke"))
        while not isinstance(taken := await anext(link), StopTaken):
            pass
        assert taken.kept, "on the disk, although nothing named a directory"
    async with planar_bridge() as address, RobotLink(*address, "operator") as link:
        while not isinstance(feedback := await anext(link), Feedback):
            pass
        assert (feedback.stop.stopped, feedback.stop.number, feedback.stop.reason) == (True, taken.number, "smoke")


async def test_a_second_bridge_of_the_same_robot_is_refused_and_told_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    async with planar_bridge():
        command = (sys.executable, "-m", "lockstep.robot_bridge", "planar", "--port", "0")
        second = await asyncio.create_subprocess_exec(*command, stderr=asyncio.subprocess.PIPE)
        async with asyncio.timeout(20):
            _, said = await second.communicate()
        assert second.returncode == 1
        assert b"planar: another bridge keeps its stop here" in said
        assert b"--state-dir DIR" in said
        async with planar_bridge("--state-dir", str(tmp_path / "second")):
            pass


async def test_a_stop_that_was_kept_by_port_before_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    older = StopStore(tmp_path / "lockstep" / "bridges" / "planar-5600")
    older.open()
    older.write(Kept(latch=StopRecord(stopped=True, reason="smoke", number=41), ended=True))
    older.close()
    async with planar_bridge() as address, RobotLink(*address, "operator") as link:
        while not isinstance(feedback := await anext(link), Feedback):
            pass
        assert (feedback.stop.stopped, feedback.stop.number, feedback.stop.reason) == (True, 41, "smoke")


@pytest.mark.parametrize("state", [[], ["--state-dir", "DIR"]])
def test_a_state_directory_that_is_gone_with_the_machine_is_said_to_be(
    state: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(cli, "is_in_memory", lambda directory: True)
    given = [str(tmp_path) if each == "DIR" else each for each in state]
    CliRunner().invoke(cli.robot_app, ["tractor", "--port", "5611", *given])
    assert "lost when this machine is switched off" in caplog.text


def test_an_unknown_robot_is_answered_with_those_there_are() -> None:
    result = CliRunner().invoke(cli.robot_app, ["tractor", "--port", "0"])
    assert result.exit_code == 2
    assert "no robot 'tractor'" in result.output
    assert "planar" in result.output


def test_a_robot_that_cannot_run_here_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def create(name: str) -> Robot:
        raise RobotUnavailable("no GL: install libegl1 and libgl1-mesa-dri")

    monkeypatch.setattr(cli, "create_robot", create)
    result = CliRunner().invoke(cli.robot_app, ["mobile-manipulator", "--port", "0"])
    assert result.exit_code == 1
    assert "install libegl1" in result.output


def test_an_event_log_that_cannot_be_written_is_an_error_and_not_a_traceback(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli.robot_app, ["planar", "--port", "0", "--event-log", str(tmp_path / "no" / "log")])
    assert result.exit_code == 1
    assert "No such file" in result.output


def test_beyond_loopback_it_does_not_start_without_a_secret_and_says_what_to_do() -> None:
    result = CliRunner().invoke(cli.robot_app, ["planar", "--port", "0", "--host", "0.0.0.0"])
    assert result.exit_code == 2
    assert "--link-secret-file" in result.output


def test_a_secret_that_is_too_short_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("too short")
    for arguments, environment in (
        (["--link-secret-file", str(tmp_path / "secret")], {}),
        ([], {"LOCKSTEP_LINK_SECRET": "too short"}),
        ([], {"LOCKSTEP_LINK_SECRET_FILE": str(tmp_path / "secret")}),
    ):
        result = CliRunner().invoke(cli.robot_app, ["planar", "--port", "0", *arguments], env=environment)
        assert result.exit_code == 2
        assert "at least 32 bytes" in result.output


async def test_the_secret_of_the_environment_is_asked_for_and_tls_shows_in_the_address(tmp_path: Path) -> None:
    secret = LinkSecret.draw()
    authority = Authority(tmp_path)
    certificate = authority.issue("bridge")
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge", "planar", "--port", "0", "--json", "--host", "0.0.0.0"),
        *("--link-tls-cert", str(certificate)),
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "LOCKSTEP_LINK_SECRET": secret.reveal()},
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(20):
            address = json.loads(await process.stdout.readline())["robot"]
        assert address.startswith("tls://0.0.0.0:")
        tls = LinkTls(authority=authority.certificate).client_context()
        port = int(address.rpartition(":")[2])
        async with RobotLink("127.0.0.1", port, "events", secret=secret, tls=tls) as link:
            await anext(link)
        with pytest.raises(LinkRefused, match="unauthorised"):
            await RobotLink("127.0.0.1", port, "events", tls=tls).connect()
    finally:
        process.terminate()
        async with asyncio.timeout(20):
            await process.communicate()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["planar", "--robot.type=so101_follower"], "no such option"),
        (["--colour", "red"], "no such option"),
        (["planar", "--ros2", "a.yaml", "--lerobot", "b.yaml", "--port", "0"], "a bridge has one robot"),
        (["lerobot", "--colour", "red"], "neither module:Class nor"),
        (["lerobot", "--robot.type=so101_follower"], "LeRobot is missing"),
    ],
)
def test_only_lerobot_takes_flags_of_lerobot(words: list[str], said: str, tmp_path: Path) -> None:
    asked = CliRunner().invoke(cli.robot_app, [*words, "--state-dir", str(tmp_path)], terminal_width=200)
    assert asked.exit_code in (1, 2)
    assert said in " ".join(asked.output.replace("│", " ").split())
