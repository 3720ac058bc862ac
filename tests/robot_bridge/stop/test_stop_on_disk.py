"""The latched stop of a real bridge over restarts, kills and a disk that fails."""

import asyncio
import signal
import sys
from pathlib import Path

import pytest

from lockstep.protocol.messages import Refusal, Reset, Stop, StopTaken
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import StateDirInUse
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.stop.stop_store import Kept, StopStore
from tests.robot_bridge.bridge_helpers import NEUTRAL, Operator, RecordingRobot, operator

PRESS = "0123456789abcdef" * 2


def bridge_in(directory: Path, robot: RecordingRobot | None = None) -> Bridge:
    return Bridge(robot or RecordingRobot(), BridgeSettings(port=0, state_dir=directory))


class Disk:
    """Takes what is written, or not, or only when it is let."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.full = False
        self.written: list[Kept] = []
        self._loop = asyncio.get_running_loop()
        self._may = asyncio.Event()
        self._may.set()
        self._write = StopStore.write
        disk = self

        def write(store: StopStore, kept: Kept) -> None:
            asyncio.run_coroutine_threadsafe(disk._may.wait(), disk._loop).result(10)
            if disk.full:
                raise OSError(28, "No space left on device")
            disk._write(store, kept)
            disk.written.append(kept)

        monkeypatch.setattr(StopStore, "write", write)

    def hold(self) -> None:
        self._may.clear()

    def go_on(self) -> None:
        self._may.set()


@pytest.fixture
async def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


async def test_a_latched_stop_outlives_the_bridge_with_its_reason_number_and_press(tmp_path: Path) -> None:
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        driver.link.send(Stop(press=PRESS, by="Ada", reason="person in the cell"))
        taken = await driver.next(StopTaken)
        assert taken.kept
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        stop = driver.feedback.stop
        assert (stop.stopped, stop.by, stop.reason) == (True, "Ada", "person in the cell")
        assert (stop.number, stop.press, stop.kept) == (taken.number, PRESS, True)
        driver.link.send(Stop(press=PRESS))
        assert (await driver.next(StopTaken)).number == taken.number, "a repeat is no new stop after a restart either"
        await driver.reset()
    async with bridge_in(tmp_path) as bridge, operator(bridge, armed=False) as driver:
        assert not driver.feedback.stop.stopped
        driver.link.send(Stop(press=PRESS))
        assert (await driver.next(StopTaken)).number == taken.number, "a late copy does not undo the reset"
        assert not driver.feedback.stop.stopped
        await driver.arm()
        driver.link.send(Stop(press=PRESS))
        assert (await driver.next(StopTaken)).number > taken.number


RUN = """
import asyncio, sys
from pathlib import Path
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar import create
from lockstep.robot_bridge.settings import BridgeSettings

async def main():
    async with Bridge(create(), BridgeSettings(port=0, state_dir=Path(sys.argv[1]))) as bridge:
        print(bridge.address[1], flush=True)
        await asyncio.Event().wait()

asyncio.run(main())
"""


async def test_a_bridge_that_was_killed_begins_stopped_and_says_why(tmp_path: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", RUN, str(tmp_path), stdout=asyncio.subprocess.PIPE
    )
    assert process.stdout is not None
    assert await process.stdout.readline()
    process.send_signal(signal.SIGKILL)
    await process.wait()
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        stop = driver.feedback.stop
        assert stop.stopped
        assert "did not shut down cleanly" in stop.reason
        await driver.reset()


async def test_a_robot_that_failed_begins_stopped_with_the_fault(tmp_path: Path) -> None:
    class BrokenRobot(RecordingRobot):
        def tick(self) -> None:
            raise OSError("the bus is gone")

    async with bridge_in(tmp_path, BrokenRobot()) as bridge:
        with pytest.raises(Exception, match="the bus is gone"):
            await bridge.wait()
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        assert driver.feedback.stop.stopped
        assert "the bus is gone" in driver.feedback.stop.reason


async def test_two_bridges_do_not_share_a_directory(tmp_path: Path) -> None:
    robot = RecordingRobot()
    async with bridge_in(tmp_path):
        with pytest.raises(StateDirInUse):
            await bridge_in(tmp_path, robot).start()
    assert robot.calls[-1] == "close"


async def test_the_robot_rests_and_feedback_says_so_while_the_disk_is_slow(tmp_path: Path, disk: Disk) -> None:
    robot = RecordingRobot()
    async with bridge_in(tmp_path, robot) as bridge, operator(bridge) as driver:
        await driver.drive()
        disk.hold()
        driver.link.send(Stop(press=PRESS))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        assert not driver.feedback.stop.kept
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        disk.go_on()
        taken = await driver.next(StopTaken)
        assert (taken.press, taken.kept) == (PRESS, True)
        assert disk.written[-1].latch.stopped
        await driver.heard(lambda feedback: feedback.stop.kept)


async def test_a_stop_that_cannot_be_written_holds_says_so_and_is_written_later(tmp_path: Path, disk: Disk) -> None:
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        disk.full = True
        driver.link.send(Stop(press=PRESS))
        assert not (await driver.next(StopTaken)).kept
        await driver.heard(lambda feedback: feedback.stop.stopped and not feedback.stop.kept)
        disk.full = False
        await driver.heard(lambda feedback: feedback.stop.kept)
        driver.link.send(Stop(press=PRESS))
        assert (await driver.next(StopTaken)).kept


async def test_a_stop_whose_directory_is_removed_is_written_again_or_everybody_is_told_that_it_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.robot_bridge.stop.stop_keeper.LOOK", 0.05)
    directory = tmp_path / "stops" / "robot"
    async with bridge_in(directory) as bridge, operator(bridge) as driver:
        driver.link.send(Stop(press=PRESS))
        assert (await driver.next(StopTaken)).kept
        await driver.heard(lambda feedback: feedback.stop.kept)
        (tmp_path / "stops").rename(tmp_path / "elsewhere")
        (tmp_path / "stops").write_text("no directory")
        await driver.heard(lambda feedback: feedback.stop.stopped and not feedback.stop.kept)
        driver.link.send(Stop(press=PRESS))
        assert not (await driver.next(StopTaken)).kept
        (tmp_path / "stops").unlink()
        await driver.heard(lambda feedback: feedback.stop.kept)
        await driver.reset()
    async with bridge_in(directory) as bridge, operator(bridge, armed=False) as driver:
        assert (driver.feedback.stop.stopped, driver.feedback.stop.press) == (False, PRESS)


async def test_a_reset_takes_effect_only_when_it_is_on_the_disk(tmp_path: Path, disk: Disk) -> None:
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        number = await stop_for_a_second(driver)
        disk.hold()
        driver.link.send(Reset(number=number))
        later = driver.feedback.time + 0.6
        await driver.heard(lambda feedback: feedback.time > later)
        assert driver.feedback.stop.stopped
        disk.go_on()
        await driver.heard(lambda feedback: not feedback.stop.stopped)
        assert not disk.written[-1].latch.stopped


async def test_a_reset_that_cannot_be_written_is_refused_and_the_stop_holds(tmp_path: Path, disk: Disk) -> None:
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        number = await stop_for_a_second(driver)
        disk.full = True
        refusal = await driver.refused(Reset(number=number))
        assert (refusal.reason, refusal.stop) == ("not_kept", number)
        assert "No space left" in refusal.detail
        disk.full = False
        await driver.heard(lambda feedback: feedback.stop.kept)
        assert driver.feedback.stop.stopped
        assert disk.written[-1].latch.stopped, "whatever the disk had of the reset is written over"
        await driver.reset()


async def test_a_stop_that_comes_while_a_reset_is_written_wins(tmp_path: Path, disk: Disk) -> None:
    async with bridge_in(tmp_path) as bridge, operator(bridge) as driver:
        number = await stop_for_a_second(driver)
        disk.hold()
        driver.link.send(Reset(number=number))
        driver.link.send(Stop(press=PRESS))
        refusal = await driver.next(Refusal)
        assert (refusal.reason, refusal.stop) == ("stale_reset", number)
        disk.go_on()
        taken = await driver.next(StopTaken)
        assert taken.number > number
        await driver.heard(lambda feedback: feedback.stop.kept)
        assert driver.feedback.stop.stopped
    assert disk.written[-1].latch.stopped


async def stop_for_a_second(driver: Operator) -> int:
    driver.link.send(Stop())
    await driver.heard(lambda feedback: feedback.stop.stopped and feedback.stop.kept)
    until = driver.feedback.time + 1.0
    await driver.heard(lambda feedback: feedback.time > until)
    return driver.feedback.stop.number
