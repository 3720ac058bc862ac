"""A bridge that hangs: something beside its loop brings the robot to rest, and whoever drives begins anew."""

import asyncio
import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import LinkError
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.errors import RobotFailed, RobotUnavailable
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.watchdog import watchdog_process
from lockstep.robot_bridge.watchdog.watchdog_process import LAST_ACTS, LEAVING, MOVING, RESTING, WatchdogProcess, watch
from lockstep.robot_bridge.watchdog.watchdog_thread import WatchdogThread
from lockstep.robot_bridge.watchdog.watchdogs import Watchdogs
from tests.robot_bridge.bridge_helpers import NEUTRAL, Operator, RecordingRobot, log_lines, operator, running_bridge
from tests.waiting import PATIENCE

LIMIT = 0.1  # s
FAST = 0.2  # m/s


class Hangs(RecordingRobot):
    """Hangs in one method until it is brought to rest from a thread, and remembers what reached it in which order."""

    def __init__(self, method: str) -> None:
        super().__init__()
        self.hangs_in = ""
        self.method = method
        self.rested = threading.Event()
        self.wire: list[list[float]] = []  # what the motors were told

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), watchdog=LIMIT)

    def _call(self, name: str) -> None:
        if self.hangs_in == name:
            self.hangs_in = ""
            assert self.rested.wait(PATIENCE), "nobody brought the robot to rest"

    def apply(self, values: Sequence[float]) -> None:
        self._call("apply")
        self.wire.append(list(values))
        super().apply(values)

    def tick(self) -> None:
        self._call("tick")
        super().tick()

    def measure(self) -> Measurement:
        self._call("measure")
        return super().measure()

    def prepare(self) -> None:
        self._call("prepare")
        super().prepare()

    def positions(self) -> Sequence[float]:
        self._call("positions")
        return super().positions()

    def rest_from_thread(self) -> None:
        self.wire.append(NEUTRAL)
        super().rest_from_thread()
        self.rested.set()


async def drive_fast(robot: RecordingRobot, driver: Operator) -> None:
    while abs(robot.state.vx) < FAST:
        await driver.drive()


@pytest.mark.parametrize("method", ["apply", "tick", "measure", "prepare", "positions"])
async def test_a_robot_whose_call_hangs_is_brought_to_rest_beside_it_and_moves_on_only_after_a_neutral(
    method: str, tmp_path: Path
) -> None:
    robot, log = Hangs(method), tmp_path / "log"
    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        await drive_fast(robot, driver)
        robot.hangs_in = method
        with contextlib.suppress(AssertionError):
            driver.link.send(driver.command())
            await driver.heard(lambda feedback: feedback.neutral_needed)
        assert robot.rested.is_set()
        assert any("held up" in fault for fault in driver.feedback.faults)
        assert bridge.counters.stalls >= 1
        assert bridge.counters.watchdog >= 1
        acted = robot.wire.index(NEUTRAL, first_motion(robot.wire))
        late = 1 if method == "apply" else 0  # the call that hung still writes when it goes on
        assert all(values == NEUTRAL for values in robot.wire[acted + late + 1 :])
        assert (await driver.refused(driver.command())).reason == "not_neutral"
        await driver.arm()
        await driver.drive()
        assert not any("held up" in fault for fault in driver.feedback.faults)
    assert any(line["watchdog"] for line in log_lines(log, "stall"))


def first_motion(wire: list[list[float]]) -> int:
    return next(index for index, values in enumerate(wire) if values != NEUTRAL)


class Fails(RecordingRobot):
    """Works but for its measurement, which raises when it is told to; ramps for longer than its watchdog waits."""

    def __init__(self) -> None:
        super().__init__()
        self.fails = False
        self.rests_beside = 0

    def describe(self) -> RobotDescription:
        description = super().describe()
        slow = tuple(msgspec.structs.replace(axis, brake=axis.maximum / 2) for axis in description.axes)
        return msgspec.structs.replace(description, axes=slow, hold=5.0, watchdog=LIMIT)

    def measure(self) -> Measurement:
        if self.fails:
            raise OSError("no answer")
        return super().measure()

    def rest_from_thread(self) -> None:
        self.rests_beside += 1
        super().rest_from_thread()


async def test_a_robot_that_is_brought_to_rest_by_its_ramp_is_not_cut_short_by_the_watchdog() -> None:
    robot = Fails()
    async with running_bridge(robot) as bridge:
        with contextlib.suppress(LinkError):
            async with operator(bridge) as driver:
                await drive_fast(robot, driver)
                robot.fails = True
                while True:
                    await driver.drive()
        with pytest.raises(RobotFailed):
            await bridge.wait()
        assert robot.applied[-1][1] == NEUTRAL
        assert robot.rests_beside == 0


class Clock:
    """The machine's, and what it was suspended for besides."""

    def __init__(self) -> None:
        self.suspended = 0.0

    def __call__(self) -> float:
        return time.monotonic() + self.suspended


async def test_after_a_suspend_the_robot_rests_at_once_and_what_was_underway_moves_nothing(tmp_path: Path) -> None:
    class Patient(RecordingRobot):
        def describe(self) -> RobotDescription:
            return msgspec.structs.replace(super().describe(), hold=5.0, watchdog=2.0, max_event_age=10.0)

    now, robot = Clock(), Patient()
    settings = BridgeSettings(port=0, event_log=tmp_path / "log")
    async with Bridge(robot, settings, now) as bridge, operator(bridge) as driver:
        await drive_fast(robot, driver)
        applied = len(robot.applied)
        now.suspended += 3600.0
        driver.link.send(driver.command())
        await driver.heard(lambda feedback: feedback.neutral_needed)
        moved = [values for _, values in robot.applied[applied:]]
        assert moved[moved.index(NEUTRAL) :] == [NEUTRAL] * (len(moved) - moved.index(NEUTRAL))
        assert moved.index(NEUTRAL) <= 1
    assert log_lines(tmp_path / "log", "stall")


async def test_a_command_of_before_a_suspend_is_late() -> None:
    now, robot = Clock(), RecordingRobot()
    async with Bridge(robot, BridgeSettings(port=0), now) as bridge, operator(bridge) as driver:
        command = driver.command(NEUTRAL)
        now.suspended += 3600.0
        assert (await driver.refused(command)).reason == "late"
        await driver.arm()


# the thread


@asynccontextmanager
async def watched_robot() -> AsyncIterator[tuple[Watchdogs, threading.Event]]:
    """The watchdogs of a robot that declares a call beside a hung tick, and whether that call was made."""
    robot = RecordingRobot()
    acted = threading.Event()
    robot.rest_from_thread = acted.set  # type: ignore[method-assign]
    watchdogs = Watchdogs(robot, LIMIT, clock.now)
    await watchdogs.start()
    try:
        yield watchdogs, acted
    finally:
        watchdogs.close()


async def test_a_watchdog_that_acts_while_a_tick_begins_is_told_with_the_time_that_it_waited() -> None:
    async with watched_robot() as (watchdogs, acted):
        began = clock.now()
        assert watchdogs.begin(began, False) is None
        watchdogs.ticked(began, True)
        assert await asyncio.to_thread(acted.wait, PATIENCE)
        held = watchdogs.begin(began + 0.004, True)
    assert held is not None
    assert held.acted
    assert held.seconds >= LIMIT


async def test_a_bridge_that_hangs_while_it_applies_rest_is_one_that_hangs_in_motion() -> None:
    async with watched_robot() as (watchdogs, acted):
        watchdogs.ticked(clock.now(), True)
        watchdogs.ticked(clock.now(), False)
        assert await asyncio.to_thread(acted.wait, PATIENCE)
        acted.clear()
        watchdogs.begin(clock.now(), True)
        watchdogs.ticked(clock.now() + 2 * LIMIT, False)  # rest was applied long enough
        assert not await asyncio.to_thread(acted.wait, 3 * LIMIT)


def test_the_thread_acts_again_and_again_while_nothing_comes_and_only_for_a_robot_that_moves() -> None:
    acts: list[float] = []
    often = threading.Event()

    def act() -> None:
        acts.append(time.monotonic())
        if len(acts) == 3:
            often.set()
        raise OSError("not this time")

    watchdog = WatchdogThread(0.02, act)
    watchdog.start()
    try:
        watchdog.ticked(time.clock_gettime(time.CLOCK_BOOTTIME) - 5.0, False)
        assert not often.wait(0.1)
        assert not acts
        watchdog.ticked(time.clock_gettime(time.CLOCK_BOOTTIME), True)
        assert often.wait(PATIENCE)
        assert watchdog.take_acted()
    finally:
        watchdog.close()


# the process


def test_the_process_acts_when_nothing_comes_while_the_robot_moves_and_not_otherwise() -> None:
    acts = _watched([MOVING], LEAVING, until=lambda acts: len(acts) >= 2)
    assert len(acts) >= 2
    assert _watched([MOVING, RESTING], LEAVING, until=None) == []


def test_the_process_acts_again_and_again_when_the_bridge_is_gone_while_the_robot_moves() -> None:
    """Whoever listens may not have found it at the first."""
    assert len(_watched([MOVING], b"", until=None, limit=60.0)) == LAST_ACTS
    assert _watched([MOVING, RESTING], b"", until=None, limit=60.0) == []
    assert _watched([MOVING], LEAVING, until=None, limit=60.0) == []


def test_the_process_acts_until_somebody_has_heard_of_it_for_long_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Discovery may take longer than those acts."""
    monkeypatch.setattr(watchdog_process, "LAST_INTERVAL", 0.001)
    acts = _watched([MOVING], b"", until=None, limit=60.0, unheard=2 * LAST_ACTS)
    assert len(acts) == 3 * LAST_ACTS
    monkeypatch.setattr(watchdog_process, "LAST_SECONDS", 0.05)
    assert _watched([MOVING], b"", until=None, limit=60.0, unheard=10**9), "and for a while where nobody ever does"


def _watched(
    says: Sequence[bytes],
    last: bytes,
    *,
    until: Callable[[list[int]], bool] | None,
    limit: float = 0.02,
    unheard: int = 0,
) -> list[int]:
    """What `watch` does with these messages: its acts. `unheard`: of so many at first nobody can have heard."""
    acts: list[int] = []
    acted = threading.Event()

    def act() -> bool:
        acts.append(1)
        if until is not None and until(acts):
            acted.set()
        return len(acts) > unheard

    (heard, tell), (hear, said) = os.pipe(), os.pipe()
    thread = threading.Thread(target=watch, args=(heard, said, limit, act))
    os.write(tell, b"".join(says))
    thread.start()
    if until is not None:
        assert acted.wait(PATIENCE)
    if last:
        os.write(tell, last)
    os.close(tell)
    thread.join(PATIENCE)
    for descriptor in (heard, hear, said):
        os.close(descriptor)
    return acts


def test_a_function_that_cannot_be_had_is_said_at_the_start() -> None:
    with pytest.raises(RobotUnavailable, match="nowhere:nothing"):
        WatchdogProcess(LIMIT, "nowhere:nothing").start()


A_BRIDGE = """
import asyncio, ctypes, json, os, sys
import msgspec
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings

class Robot(PlanarRobot):
    rests_from_thread = sys.argv[1] != "process"
    rest_call = "" if sys.argv[1] == "thread" else "rest_the_robot:prepare"
    rest_arguments = ("at_rest",)

    def describe(self):
        return msgspec.structs.replace(super().describe(), watchdog=0.1)

    def tick(self):
        if os.path.exists("hang"):
            ctypes.PyDLL(None).sleep(60)  # native code that keeps the interpreter's lock
        super().tick()

async def main():
    async with Bridge(Robot(), BridgeSettings(port=0)) as bridge:
        print(json.dumps(bridge.address[1]), flush=True)
        await asyncio.Event().wait()

asyncio.run(main())
"""

REST = """
def prepare(name="rested"):
    def rest():
        open(name, "a").write("x")
    print("a library's banner")
    return rest
"""


class _Address:
    def __init__(self, port: int) -> None:
        self.address = ("127.0.0.1", port)


@pytest.mark.parametrize("how", ["locked", "killed", "frozen"])
async def test_a_bridge_whose_interpreter_is_stuck_or_killed_is_outlived_by_its_watchdog_process(
    how: str, tmp_path: Path
) -> None:
    (tmp_path / "rest_the_robot.py").write_text(REST)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.getcwd()])}
    bridge = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", A_BRIDGE, "process"), stdout=asyncio.subprocess.PIPE, cwd=tmp_path, env=environment
    )
    try:
        assert bridge.stdout is not None
        async with asyncio.timeout(20):
            port = json.loads(await bridge.stdout.readline())
            with contextlib.suppress(LinkError, AssertionError, TimeoutError):
                async with operator(_Address(port)) as driver:
                    while driver.feedback.axes[0] < FAST:
                        await driver.drive()
                    if how == "locked":
                        (tmp_path / "hang").touch()
                    else:
                        bridge.send_signal(signal.SIGKILL if how == "killed" else signal.SIGSTOP)
                    await driver.drive()
            while True:
                if (tmp_path / "at_rest").exists():
                    break
                await asyncio.sleep(0.01)
    finally:
        with contextlib.suppress(ProcessLookupError):
            bridge.kill()
        await bridge.wait()


async def test_a_watchdog_process_that_is_killed_takes_the_robot_to_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rest_the_robot.py").write_text(REST)
    monkeypatch.syspath_prepend(str(tmp_path))
    started: list[int] = []
    start = WatchdogProcess.start

    def noted(process: WatchdogProcess) -> None:
        start(process)
        assert process.pid is not None
        started.append(process.pid)

    monkeypatch.setattr(WatchdogProcess, "start", noted)

    class Watched(RecordingRobot):
        rest_call = "rest_the_robot:prepare"

    robot = Watched()
    async with Bridge(robot, BridgeSettings(port=0)) as bridge:
        with contextlib.suppress(LinkError):
            async with operator(bridge) as driver:
                await drive_fast(robot, driver)
                os.kill(started[0], signal.SIGKILL)
                while True:
                    await driver.drive()
        with pytest.raises(RobotFailed, match="watchdog process has ended"):
            await bridge.wait()
    assert robot.applied[-1][1] == NEUTRAL
