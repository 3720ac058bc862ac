"""A robot that fails, over the real bridge: whatever raises, what was applied last is rest, and the stop is latched."""

import asyncio
import contextlib
import json
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from lockstep.protocol.errors import LinkError, LinkLost
from lockstep.protocol.messages import Feedback, Goodbye
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import RobotFailed
from lockstep.robot_bridge.link.link_server import LinkServer
from lockstep.robot_bridge.robots.base import Measurement, MediaSource
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import DRIVE, NEUTRAL, Operator, RecordingRobot, operator, running_bridge

FAST = 0.2  # m/s


class BreakableRobot(RecordingRobot):
    """Works until `broken` has an error for a method; `often` is how many calls of it raise."""

    def __init__(self) -> None:
        super().__init__()
        self.broken: dict[str, BaseException] = {}
        self.often = 1
        self.failed = 0
        self.applied_before = 0  # how many values were applied before it failed

    def _call(self, name: str) -> None:
        if name in self.broken and self.failed < self.often:
            self.failed += 1
            self.applied_before = len(self.applied)
            raise self.broken[name]

    def apply(self, values: Sequence[float]) -> None:
        self._call("apply")
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


async def drive_fast(robot: RecordingRobot, driver: Operator) -> None:
    while abs(robot.state.vx) < FAST:
        await driver.drive()


async def fed_back(driver: Operator) -> tuple[Feedback, str]:
    """The last feedback, and why the link ended."""
    try:
        await driver.next(Goodbye)
    except LinkLost as lost:
        return driver.feedback, str(lost)
    raise AssertionError("the link goes on")


@pytest.mark.parametrize("often", [1, sys.maxsize], ids=["once", "always"])
@pytest.mark.parametrize("method", ["apply", "tick", "measure", "prepare", "positions"])
@pytest.mark.parametrize(
    "error",
    [OSError("no answer"), SystemExit(3), KeyboardInterrupt(), asyncio.CancelledError(), BaseException("odd")],
    ids=lambda error: type(error).__name__,
)
async def test_whatever_the_adapter_raises_the_last_values_are_at_rest_and_the_stop_is_latched(
    method: str, error: BaseException, often: int
) -> None:
    robot = BreakableRobot()
    robot.often = often
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            await drive_fast(robot, driver)
            robot.broken[method] = error
            driver.link.send(driver.command(DRIVE))
            with pytest.raises(RobotFailed, match=type(error).__name__):
                await bridge.wait()
            feedback, goodbye = await fed_back(driver)
        if method != "apply" or often == 1:
            assert robot.applied[-1][1] == NEUTRAL
        assert robot.calls[-1] == "stop"
        assert feedback.stop.stopped
        assert f"robot failed: {type(error).__name__}" in feedback.stop.reason
        assert feedback.stop.reason in feedback.faults
        assert "robot failed" in goodbye
    assert robot.calls[-1] == "close"


async def test_after_a_failure_the_next_bridge_begins_stopped_with_the_reason_and_the_robots_stop(
    tmp_path: Path,
) -> None:
    settings = BridgeSettings(port=0, state_dir=tmp_path / "state")
    broken = BreakableRobot()
    async with Bridge(broken, settings) as bridge:
        broken.broken["measure"] = OSError("no answer")
        with pytest.raises(RobotFailed):
            await bridge.wait()
    robot = RecordingRobot()
    async with Bridge(robot, settings) as bridge, operator(bridge) as driver:
        assert driver.feedback.stop.stopped
        assert "robot failed: OSError: no answer" in driver.feedback.stop.reason
        assert (await driver.refused(driver.command())).reason == "stopped"
        await robot.until(lambda: robot.calls == ["stop"], "the robot's own stop")
    assert all(values == NEUTRAL for _, values in robot.applied)


@pytest.mark.parametrize(
    "error", [OSError("no answer"), asyncio.CancelledError()], ids=lambda error: type(error).__name__
)
async def test_a_robot_that_cannot_be_measured_at_the_start_is_closed_and_the_next_bridge_begins_stopped(
    tmp_path: Path, error: BaseException
) -> None:
    settings = BridgeSettings(port=0, state_dir=tmp_path / "state")
    broken = BreakableRobot()
    broken.broken["measure"] = error
    bridge = Bridge(broken, settings)
    with pytest.raises(RobotFailed, match=type(error).__name__):
        await bridge.start()
    assert broken.calls[-1] == "close"
    with pytest.raises(ConnectionRefusedError):
        await asyncio.open_connection(*bridge.address)
    async with Bridge(RecordingRobot(), settings) as bridge, operator(bridge) as driver:
        assert driver.feedback.stop.stopped


async def test_a_robot_that_works_but_for_its_measurement_ramps_down() -> None:
    robot = BreakableRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await drive_fast(robot, driver)
        robot.broken["measure"] = OSError("no answer")
        driver.link.send(driver.command(DRIVE))
        with pytest.raises(RobotFailed):
            await bridge.wait()
        speeds = [values[0] for _, values in robot.applied[robot.applied_before - 1 :]]
        assert speeds[0] > 0.1
        step = bridge.description.axes[0].brake * robot.tick_seconds + 1e-9
        assert all(abs(after - before) <= step for before, after in zip(speeds, speeds[1:], strict=False))
        assert speeds[-1] == 0.0


@pytest.mark.parametrize("part", ["links", "reports"])
async def test_a_part_of_the_bridge_that_raises_leaves_the_robot_at_rest_and_stopped(
    part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = asyncio.Event()

    run = LinkServer.run

    async def fails(server: LinkServer) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(run(server))
            await broken.wait()
            raise OSError("broken")

    def raises(_: object) -> None:
        raise OSError("broken")

    if part == "links":
        monkeypatch.setattr(LinkServer, "run", fails)
    else:
        monkeypatch.setattr(Bridge, "report", raises)
    robot = RecordingRobot()
    async with Bridge(robot, BridgeSettings(port=0, log_interval=0.5)) as bridge:
        with contextlib.suppress(LinkError):
            async with operator(bridge) as driver:
                await drive_fast(robot, driver)
                broken.set()
                while True:
                    await driver.drive()
        with pytest.raises(RobotFailed, match="OSError: broken"):
            await bridge.wait()
        assert robot.applied[-1][1] == NEUTRAL
        assert robot.calls == ["stop"]


@pytest.mark.parametrize(
    "error", [OSError("no camera"), SystemExit(3), asyncio.CancelledError()], ids=lambda error: type(error).__name__
)
async def test_a_media_source_that_fails_however_is_a_fault_and_the_robot_drives_on(error: BaseException) -> None:
    class Source(MediaSource):
        async def run(self, stamp: object, emit: object) -> None:
            raise error

    class Robot(RecordingRobot):
        def sources(self) -> Sequence[MediaSource]:
            return [Source()]

    async with running_bridge(Robot()) as bridge, operator(bridge) as driver:
        await driver.heard(lambda feedback: bool(feedback.faults))
        assert type(error).__name__ in driver.feedback.faults[0]
        await driver.drive()
        assert not driver.feedback.stop.stopped


async def test_a_robot_that_cannot_even_say_what_cameras_it_has_drives_on() -> None:
    class Robot(RecordingRobot):
        def sources(self) -> Sequence[MediaSource]:
            raise OSError("no camera")

    async with running_bridge(Robot()) as bridge, operator(bridge) as driver:
        await driver.heard(lambda feedback: bool(feedback.faults))
        await driver.drive()
        assert driver.feedback.faults == ["media: OSError: no camera"]


async def test_a_bridge_whose_closing_is_cancelled_leaves_the_robot_at_rest() -> None:
    robot = RecordingRobot()
    bridge = Bridge(robot, BridgeSettings(port=0))
    await bridge.start()
    with contextlib.suppress(LinkLost):
        async with operator(bridge) as driver:
            await drive_fast(robot, driver)
            closing = asyncio.create_task(bridge.close())
            await asyncio.sleep(0)
            closing.cancel()
            await asyncio.wait([closing])
    assert robot.applied[-1][1] == NEUTRAL
    assert robot.calls == ["stop", "close"]


A_PROCESS = """
import asyncio, json, signal, sys
from lockstep.robot_bridge import cli
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings

class Robot(PlanarRobot):
    out = open(sys.argv[2], "w", buffering=1)

    def apply(self, values):
        self.out.write(json.dumps(list(values)) + "\\n")
        super().apply(values)

    def stop(self):
        self.out.write('"stop"\\n')
        super().stop()

async def serve():
    global bridge
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    bridge = Bridge(Robot(), BridgeSettings(port=0))
    await bridge.start()
    print(json.dumps({"robot": "tcp://127.0.0.1:%d" % bridge.address[1]}), flush=True)
    await ended.wait()

if sys.argv[1] == "command":
    cli.create_robot = lambda name: Robot()
    cli.robot_app(["planar", "--port", "0", "--json"])
elif sys.argv[1] == "tasks-cancelled":
    asyncio.run(serve())
elif sys.argv[1] == "loop-closed":
    loop = asyncio.new_event_loop()
    loop.run_until_complete(serve())
    loop.close()
"""


class _Process:
    def __init__(self, address: tuple[str, int]) -> None:
        self.address = address


@pytest.mark.parametrize(
    ("how", "number"),
    [
        ("command", signal.SIGTERM),
        ("command", signal.SIGINT),
        ("command", signal.SIGHUP),
        ("command", signal.SIGQUIT),
        ("tasks-cancelled", signal.SIGTERM),
        ("loop-closed", signal.SIGTERM),
    ],
)
async def test_however_the_process_ends_the_robot_is_at_rest_and_stopped_first(
    how: str, number: signal.Signals, tmp_path: Path
) -> None:
    out = tmp_path / "applied"
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", A_PROCESS, how, str(out), stdout=asyncio.subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(20):
            port = int(json.loads(await process.stdout.readline())["robot"].rpartition(":")[2])
            with contextlib.suppress(LinkLost):
                async with operator(_Process(("127.0.0.1", port))) as driver:
                    while driver.feedback.axes[0] < FAST:
                        await driver.drive()
                    process.send_signal(number)
                    while True:
                        await driver.drive()
            await process.wait()
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    assert lines[-1] == "stop"
    assert [line for line in lines if line != "stop"][-1] == NEUTRAL
