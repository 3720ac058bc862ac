"""Seeded lives of a STOP over real TCP and WebRTC: a bridge that is killed, links that break, a console, two clients.

The bridge's event log is the judge: what it executed, and what had happened before.
"""

import asyncio
import json
import secrets
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest

from client.console import Console
from client.errors import CommandRefused, ConsoleLost, SeatRefused, StopUnconfirmed
from robot_bridge.protocol.console import Role
from tests.robot_bridge.bridge_model import MotionWitness
from tests.server.rig import PATIENCE, Rig, eventually, reset_by_http, running_console

PHRASES = [
    *[("reset", "arm", "drive")] * 4,
    *[("stop_operator",), ("stop_supervisor", "drive"), ("stop_http", "stop_http"), ("stop_operator", "reset")],
    *[("arm", "drive"), ("reset_early",), ("reset_stale",), ("seat", "drive")],
    *[("cut", "drive"), ("cut", "arm", "drive"), ("stop_supervisor", "cut", "reset_early"), ("kill", "seat", "drive")],
    *[("seat", "arm", "drive")] * 2,
]
TOO_MANY = "too_many_requests"  # the same, and resets of this link come too often


class LinkPath:
    """Stands between the console and the bridge, which has another port after each start."""

    def __init__(self) -> None:
        self.target = 0
        self.port = 0
        self._ends: set[asyncio.StreamWriter] = set()

    def cut(self) -> None:
        for end in self._ends:
            end.transport.abort()

    async def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._ends.add(writer)
        try:
            other_reader, other = await asyncio.open_connection("127.0.0.1", self.target)
            self._ends.add(other)
            await asyncio.gather(self._pass_on(reader, other), self._pass_on(other_reader, writer))
        except OSError:
            writer.transport.abort()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(1 << 16):
                writer.write(data)
                await writer.drain()
        writer.transport.abort()
        self._ends.discard(writer)


class Robot:
    """A bridge in a process of its own, whose state directory and event log outlive it."""

    def __init__(self, directory: Path, path: LinkPath) -> None:
        self.log = directory / "events.jsonl"
        self._state = directory / "state"
        self._path = path
        self._process: Process | None = None

    async def start(self) -> None:
        options = ("--port", "0", "--json", "--state-dir", str(self._state), "--event-log", str(self.log))
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "robot_bridge", "planar", *options, stdout=PIPE
        )
        assert self._process.stdout is not None
        self._path.target = int(json.loads(await self._process.stdout.readline())["robot"].rpartition(":")[2])

    async def end(self, how: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            await self._process.wait()


class Player:
    """A client that connects anew when its connection ends."""

    def __init__(self, rig: Rig, role: Role) -> None:
        self.headers = rig.token(role)
        self._link = f"{rig.url}/#token={self.headers['Authorization'].removeprefix('Bearer ')}"
        self._console: Console | None = None

    async def do(self, verb: Callable[[Console], Awaitable[Any]]) -> Any:
        async with asyncio.timeout(2 * PATIENCE):
            while True:
                if self._console is None:
                    self._console = await Console(self._link, video=False, audio=False).__aenter__()
                try:
                    return await verb(self._console)
                except ConsoleLost:
                    await self.leave()

    async def leave(self) -> None:
        console, self._console = self._console, None
        if console is not None:
            await console.__aexit__(None, None, None)


class Session:
    """The steps; each returns when what it brings about has come."""

    def __init__(self, rig: Rig, robot: Robot, path: LinkPath) -> None:
        self.numbers: list[int] = []  # that pressers were told
        self._rig = rig
        self._robot = robot
        self._path = path
        self._operator, self._supervisor = Player(rig, "operator"), Player(rig, "supervisor")
        self._open: list[str] = []  # presses over HTTP that the robot had not confirmed

    async def leave(self) -> None:
        await self._operator.leave()
        await self._supervisor.leave()

    async def drive(self) -> None:
        with suppress(CommandRefused):
            for _ in range(3):
                await self._operator.do(lambda console: console.drive({console.description.axes[0].name: 0.3}))

    async def arm(self) -> None:
        with suppress(CommandRefused):
            await self._operator.do(lambda console: console.arm())

    async def seat(self) -> None:
        with suppress(SeatRefused, CommandRefused):
            await self._operator.do(lambda console: console.take_seat())

    async def stop_operator(self) -> None:
        await self._stop(self._operator)

    async def stop_supervisor(self) -> None:
        await self._stop(self._supervisor)

    async def _stop(self, player: Player) -> None:
        with suppress(StopUnconfirmed):
            self.numbers.append((await player.do(lambda console: console.stop("no"))).number)

    async def stop_http(self) -> None:
        press = secrets.token_hex(16)
        if not await self._press(press):
            self._open.append(press)

    async def _press(self, press: str) -> bool:
        headers = self._supervisor.headers
        answer = await self._rig.http.post("/api/stop", headers=headers, json={"press": press})
        if answer.status_code == 200:
            self.numbers.append(answer.json()["number"])
        else:
            assert answer.json()["error"] in ("link_down", "unconfirmed")
        return answer.status_code == 200

    async def reset(self) -> None:
        """By a data channel, and if that is refused over HTTP, until the robot takes it."""
        await self.linked()
        with suppress(CommandRefused):
            await self._supervisor.do(lambda console: console.reset())
        clock = self._rig.services.console.clock
        await reset_by_http(self._rig.http, "/api/reset", self._supervisor.headers, lambda: clock.stop)

    async def reset_early(self) -> None:
        """Right after a stop that has arrived."""
        await self.linked()
        press = secrets.token_hex(16)
        assert await self._press(press)
        assert await self._reset(self.numbers[-1]) in ("too_soon", TOO_MANY)

    async def reset_stale(self) -> None:
        await self.linked()
        await self.stop_http()
        assert await self._reset(self.numbers[-1] - 1) in ("stale_reset", TOO_MANY)

    async def _reset(self, number: int) -> str:
        answer = await self._rig.http.post("/api/reset", headers=self._supervisor.headers, json={"number": number})
        error: str = answer.json().get("error", "")
        return error

    async def cut(self) -> None:
        """Whoever asks next may find the link down or up again."""
        self._path.cut()
        await eventually(lambda: not self._rig.services.console.robot.up)

    async def kill(self) -> None:
        await self._robot.end(signal.SIGKILL)
        await self._robot.start()
        await self.linked()

    async def linked(self) -> None:
        async with asyncio.timeout(PATIENCE):
            await self._rig.services.console.robot.reached.wait()

    async def all_is_put_right(self) -> None:
        await self.linked()
        for press in self._open:
            assert await self._press(press)
        await eventually(lambda: not self._rig.services.console.stops.unconfirmed)
        await self.reset()
        await self.seat()
        await self._operator.do(lambda console: console.arm())
        await self._operator.do(lambda console: console.drive({console.description.axes[0].name: 0.3}))


class Judge:
    """Reads the event log of several runs of a bridge."""

    def __init__(self) -> None:
        self.moved_after_a_stop = 0
        self._witness = MotionWitness()
        self._issued: dict[int, int] = {}  # issue of the current event -> how many issues there had been
        self._event = 0

    def read(self, line: dict[str, Any]) -> None:
        witness = self._witness
        match line["kind"]:
            case "start":
                if line["stopped"] and line["number"] not in witness.given:
                    witness.stop(line["number"], line["time"])
                assert line["stopped"] == witness.holds, "a restart released a stop"
                assert line["stopped"] or not self._event, "a bridge that was killed began without a stop"
                witness.cause()
                self._issued.clear()
            case "stop":
                witness.stop(line["number"], line["time"])
            case "reset":
                witness.reset(line["number"], line["time"])
            case "stall":
                witness.cause()
            case "feedback":
                self._feedback(line)
            case "executed":
                moving = any(line["values"])
                witness.executed(moving=moving, answers=self._issued[line["issue"]])
                self.moved_after_a_stop += moving and bool(witness.given)

    def _feedback(self, line: dict[str, Any]) -> None:
        if line["event"] != self._event:
            self._issued.clear()
        self._event = line["event"]
        self._witness.seen += 1
        self._issued[line["issue"]] = self._witness.seen
        if self._witness.holds:
            self._witness.shown = self._witness.given[-1]


@asynccontextmanager
async def running_session(directory: Path) -> AsyncIterator[tuple[Session, Robot]]:
    async with AsyncExitStack() as stack:
        path = LinkPath()
        robot = Robot(directory, path)
        await robot.start()
        stack.push_async_callback(robot.end, signal.SIGINT)
        server = await asyncio.start_server(path.accept, "127.0.0.1", 0)
        stack.callback(server.close)
        stack.callback(path.cut)
        port = server.sockets[0].getsockname()[1]
        rig = await stack.enter_async_context(running_console(port, link_backoff=0.02, link_backoff_cap=0.1))
        session = Session(rig, robot, path)
        stack.push_async_callback(session.leave)
        await session.linked()
        await session.seat()
        await session.drive()
        yield session, robot


@pytest.mark.timeout(120)
@pytest.mark.parametrize("seed", [1, 2])
async def test_in_a_random_life_the_robot_moves_only_as_the_rules_of_a_stop_let_it(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    phrases = random.sample(PHRASES, len(PHRASES))
    async with running_session(tmp_path) as (session, robot):
        for step in (step for phrase in phrases for step in phrase):
            await getattr(session, step)()
        await session.all_is_put_right()
    judge = Judge()
    for line in robot.log.read_text().splitlines():
        judge.read(json.loads(line))
    assert judge.moved_after_a_stop > 0
    assert len(set(session.numbers)) == len(session.numbers), "two presses were told one number"
