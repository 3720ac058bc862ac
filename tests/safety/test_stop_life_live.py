"""Seeded lives of a STOP over real TCP and WebRTC, in which everything fails now and then.

The bridge's own records are the judge: what it executed, and what had happened before. What pressers were told is
compared with them.
"""

import asyncio
import secrets
import signal
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import httpx
import pytest

from lockstep.bench.harness.tcp_path import TcpPath
from lockstep.client.console import Console
from lockstep.client.errors import CommandRefused, SeatRefused, StopUnconfirmed
from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.stop.stop_latch import LEAST_STOP
from tests.safety.live_world import ConsoleProcess, Judge, Player, Robot
from tests.server.rig import PATIENCE

# Steps with a + between them run at the same time.
FAULTS = [
    ["cut", "drive"],
    ["stop_supervisor", "cut", "reset_early"],
    ["cut+stop_http", "arm", "drive"],
    ["kill_bridge", "seat", "drive"],
    ["stop_http+kill_bridge", "seat", "arm", "drive"],
    ["drive+end_bridge", "seat", "drive"],
    ["drive+kill_console", "drive", "seat", "drive"],
    ["stop_operator", "end_console", "reset_early"],
    ["away", "stop_http", "kill_console"],
    ["away", "stop_http+stop_supervisor", "kill_bridge", "back"],
    ["away", "console_disk_fails", "stop_http", "console_disk_mended", "end_console"],
    ["disk_fails", "stop_http+stop_supervisor", "reset_unkept", "drive", "disk_mended"],
    ["disk_fails", "drive+stop_operator", "kill_bridge", "seat", "arm", "drive"],
    ["disk_fails", "drive", "end_bridge", "drive"],
    ["drive+lock", "reset_locked", "arm", "unlock", "drive"],
    ["lock", "kill_bridge", "reset_locked", "unlock", "seat", "drive"],
    ["reset", "drive+intrude"],
    ["reset", "another_console", "seat", "drive"],
]
PLAIN = [
    ["stop_operator"],
    ["stop_supervisor", "drive"],
    ["stop_http+stop_http"],
    ["stop_operator", "reset"],
    ["arm", "drive"],
    ["arm+drive"],
    ["reset_early"],
    ["reset_stale"],
    ["reset+stop_http", "drive"],
    ["drive+intrude"],
]
TO_DRIVE = ["reset", "seat", "arm", "drive"]
REFUSED = ("link_down", "unconfirmed")
TOO_MANY = "too_many_requests"  # the same, and resets of this link come too often
FASTEST = 0.3


class Told(NamedTuple):
    """What a presser was told."""

    press: str
    number: int
    kept: bool  # on the robot's disk


class Session:
    """The steps; each returns when what it brings about has come."""

    def __init__(self, random: Random, console: ConsoleProcess, robot: Robot, path: TcpPath) -> None:
        self.told: list[Told] = []
        self.kept: list[str] = []  # presses that the console promised to send later
        self._random = random
        self._console, self._robot, self._path = console, robot, path
        links = console.links
        self._operator, self._supervisor = Player(links["operator"], "Op"), Player(links["supervisor"], "Sue")
        self._intruder = Player(links["operator"], "Intruder")
        self._http = httpx.AsyncClient(base_url=console.url, headers=console.token("supervisor"), trust_env=False)

    async def leave(self) -> None:
        for player in (self._operator, self._supervisor, self._intruder):
            await player.leave()
        await self._http.aclose()

    # who drives

    async def drive(self) -> None:
        with suppress(CommandRefused):
            for _ in range(3):
                await self._operator.do(lambda console: _forward(console, FASTEST))

    async def arm(self) -> None:
        with suppress(CommandRefused):
            await self._operator.do(lambda console: console.arm())

    async def seat(self) -> None:
        await self.linked()
        with suppress(SeatRefused, CommandRefused):
            await self._operator.do(lambda console: console.take_seat())

    async def intrude(self) -> None:
        """With an operator's link and without the seat: neither a neutral command passes, nor one that moves."""
        await self.linked()
        for verb in (lambda console: console.arm(), lambda console: _forward(console, -FASTEST)):
            with pytest.raises(CommandRefused) as refused:
                await self._intruder.do(verb)
            assert refused.value.reason in ("no_seat", "link_down", "stopped")

    async def another_console(self) -> None:
        """It keeps no rules: it takes the robot, and moves it as soon as it has a feedback. The bridge lets it not."""
        await self.away()
        async with self._robot_link() as link:
            feedback = await _heard(link, lambda message: isinstance(message, Feedback))
            assert isinstance(feedback, Feedback)
            event = event_after(feedback.event)
            values = [FASTEST, *[0.0] * (len(feedback.axes) - 1)]
            link.send(Command(event=event, issue=feedback.issue, nonce=feedback.nonce, values=values))
            answer = await _heard(link, lambda message: getattr(message, "event", 0) == event)
        assert isinstance(answer, Refusal)
        assert answer.reason in ("not_neutral", "stopped")
        await self.back()

    @asynccontextmanager
    async def _robot_link(self) -> AsyncIterator[RobotLink]:
        """Under the name of the console, for which the bridge keeps the robot when its link breaks."""
        async with asyncio.timeout(PATIENCE):
            while True:
                with suppress(LinkRefused):  # until the bridge knows that the other is gone
                    async with RobotLink(*self._path.target, "operator", name=self._console.name) as link:
                        yield link
                        return
                await asyncio.sleep(0.02)

    # STOP

    async def stop_operator(self) -> None:
        await self._stop(self._operator)

    async def stop_supervisor(self) -> None:
        await self._stop(self._supervisor)

    async def _stop(self, player: Player) -> None:
        failed = self._robot.disk.fails
        with suppress(StopUnconfirmed):
            stop = await player.do(lambda console: console.stop("no"))
            self.told.append(Told(stop.press, stop.number, stop.kept))
            assert not (stop.kept and failed and self._robot.disk.fails), "kept, on a disk that takes nothing"

    async def stop_http(self) -> None:
        await self._press()

    async def _press(self) -> int | None:
        """The number; None: the console did not tell one."""
        press, failed = secrets.token_hex(16), self._robot.disk.fails
        answer = await self._ask("/api/stop", {"press": press})
        if answer is None:
            return None
        said = answer.json()
        if answer.status_code == httpx.codes.OK:
            assert said["delivered"]
            self.told.append(Told(press, said["number"], not (failed or self._robot.disk.fails)))
            return int(said["number"])
        assert said["error"] in REFUSED, said
        if "the stop is not on the console's disk" not in said["detail"]:
            assert "kept" in said["detail"]
            self.kept.append(press)
        return None

    # reset

    async def reset(self) -> None:
        """By a data channel, and if that is refused over HTTP, until the robot takes it."""
        await self.linked()
        if self._random.random() < 0.5:
            with suppress(CommandRefused):
                await self._supervisor.do(lambda console: console.reset())
        async with asyncio.timeout(3 * PATIENCE):
            while (held := self._robot.held) is not None:
                number, since = held
                await asyncio.sleep(since + LEAST_STOP - time.monotonic())
                if await self._reset(number) == TOO_MANY:
                    await asyncio.sleep(LEAST_STOP)

    async def reset_early(self) -> None:
        """Right after a stop that has arrived."""
        await self.linked()
        number = await self._press()
        assert number is None or await self._reset(number) in ("too_soon", "stale_reset", TOO_MANY)

    async def reset_stale(self) -> None:
        await self.linked()
        number = await self._press()
        assert number is None or await self._reset(number - 1) in ("stale_reset", TOO_MANY)

    async def reset_unkept(self) -> None:
        """A stop that cannot be written is not released by what cannot be written either."""
        await self._refused_reset("not_kept")

    async def reset_locked(self) -> None:
        await self._refused_reset("locked_out")

    async def _refused_reset(self, reason: str) -> None:
        await self.linked()
        assert self._robot.held is not None
        number, since = self._robot.held
        await asyncio.sleep(since + LEAST_STOP - time.monotonic())
        assert await self._reset(number) in (reason, TOO_MANY)
        assert self._robot.held == (number, since)

    async def _reset(self, number: int) -> str:
        """Why not; "" when the robot is released, or nobody answered."""
        answer = await self._ask("/api/reset", {"number": number})
        return "" if answer is None else str(answer.json().get("error", ""))

    async def _ask(self, path: str, body: dict[str, Any]) -> httpx.Response | None:
        """None: the console was killed meanwhile."""
        with suppress(httpx.TransportError):
            return await self._http.post(path, json=body)
        return None

    # what fails

    async def cut(self) -> None:
        """Whoever asks next may find the link down or up again."""
        self._path.cut()

    async def away(self) -> None:
        self._path.away = True
        self._path.cut()
        await self._until_link("down")

    async def back(self) -> None:
        self._path.away = False
        await self.linked()
        await self.kept_stops_arrive()

    async def kill_bridge(self) -> None:
        await self._restart_bridge(signal.SIGKILL)

    async def end_bridge(self) -> None:
        await self._restart_bridge(signal.SIGTERM)

    async def _restart_bridge(self, how: signal.Signals) -> None:
        await self._robot.end(how)
        await self._robot.start()

    async def kill_console(self) -> None:
        await self._restart_console(signal.SIGKILL)

    async def end_console(self) -> None:
        await self._restart_console(signal.SIGTERM)

    async def _restart_console(self, how: signal.Signals) -> None:
        await self._console.end(how)
        self._path.away = False
        await self._console.start()
        await self.kept_stops_arrive()

    async def kept_stops_arrive(self) -> None:
        """Nobody presses again: what was promised comes by itself."""
        kept, self.kept = self.kept, []
        await self._robot.until(lambda: self._robot.numbers.keys() >= set(kept))

    async def disk_fails(self) -> None:
        self._robot.fail_disk(self._random)

    async def disk_mended(self) -> None:
        self._robot.disk.mend()

    async def console_disk_fails(self) -> None:
        self._console.fail_disk(self._random)

    async def console_disk_mended(self) -> None:
        self._console.disk.mend()

    async def lock(self) -> None:
        await self._robot.lock()

    async def unlock(self) -> None:
        await self._robot.unlock()

    async def linked(self) -> None:
        await self._until_link("up")

    async def _until_link(self, state: str) -> None:
        """Asked for again and again: there is no event for it over HTTP."""
        async with asyncio.timeout(2 * PATIENCE):
            while True:
                with suppress(httpx.TransportError):
                    if (await self._http.get("/healthz")).json()["robot_link"] == state:
                        return
                await asyncio.sleep(0.05)

    async def step(self, words: str) -> None:
        await asyncio.gather(*(getattr(self, word)() for word in words.split("+")))


async def _heard(link: RobotLink, wanted: Callable[[LinkMessage], bool]) -> LinkMessage:
    async with asyncio.timeout(PATIENCE):
        while not wanted(message := await anext(link)):
            pass
    return message


async def _forward(console: Console, speed: float) -> Feedback:
    return await console.drive({console.description.axes[0].name: speed})


@asynccontextmanager
async def running_session(directory: Path, random: Random) -> AsyncIterator[tuple[Session, Robot]]:
    async with AsyncExitStack() as stack:
        path = await stack.enter_async_context(TcpPath(("127.0.0.1", 0)))
        robot = Robot(directory, path)
        await robot.start()
        stack.push_async_callback(robot.end, signal.SIGTERM)
        console = ConsoleProcess(directory / "console", path)
        await console.start()
        stack.push_async_callback(console.end, signal.SIGTERM)
        session = Session(random, console, robot, path)
        stack.push_async_callback(session.leave)
        await session.seat()
        await session.drive()
        yield session, robot


def life(random: Random, faults: list[list[str]]) -> list[str]:
    """Each fault once, with something plain before it, while the robot could be driven or not."""
    steps: list[str] = []
    for fault in faults:
        steps += TO_DRIVE if random.random() < 0.6 else []
        steps += [*random.choice(PLAIN), *fault]
    return [*steps, *TO_DRIVE]


@pytest.mark.timeout(240)
@pytest.mark.parametrize("part", [0, 1])
async def test_in_a_random_life_the_robot_moves_only_as_the_rules_of_a_stop_let_it(tmp_path: Path, part: int) -> None:
    faults = Random(7).sample(FAULTS, len(FAULTS))[part::2]
    random = Random(part)
    steps = life(random, faults)
    async with running_session(tmp_path, random) as (session, robot):
        for step in steps:
            await session.step(step)
        await session.kept_stops_arrive()
    judge = Judge()
    for record in robot.records:
        judge.read(record)
    assert judge.moved_after_a_stop > 0
    told = [each.number for each in session.told]
    assert len(set(told)) == len(told), "two presses were told one number"
    for each in session.told:
        # A kill may have cut the record off, and what was not kept has another number in the bridge's next run.
        numbers = robot.numbers.get(each.press, set()) if each.kept else {each.number}
        numbers = numbers or {each.number}
        assert each.number in numbers, "another number than was told"
        assert not each.kept or len(numbers) == 1, "a press that was on the disk became another stop"
    assert not session.kept
