"""Somebody at the robot comes before whoever is far away, over a real bridge."""

from pathlib import Path

from lockstep.protocol.messages import Reset
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import NEUTRAL, RecordingRobot, operator, running_bridge


class KeyedRobot(RecordingRobot):
    key = ""

    def locked_out(self) -> str:
        return self.key


async def test_a_robot_that_is_locked_rests_says_why_and_takes_no_reset() -> None:
    robot = KeyedRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(5):
            await driver.drive()
        robot.key = "key switch"
        await driver.heard(lambda feedback: feedback.stop.locked_out == "key switch")
        assert driver.feedback.stop.stopped
        assert driver.feedback.stop.reason == "key switch"
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        assert (await driver.refused(driver.command())).reason == "stopped"
        number = driver.feedback.stop.number
        refusal = await driver.refused(Reset(number=number))
        assert (refusal.reason, refusal.stop, refusal.detail) == ("locked_out", number, "key switch")
        robot.key = ""
        await driver.heard(lambda feedback: not feedback.stop.locked_out)
        assert driver.feedback.stop.stopped, "the end of a lock-out releases nothing"
        await driver.reset()
        assert (await driver.refused(driver.command())).reason == "not_neutral"
        await driver.arm()
        await driver.drive()


async def test_a_switch_file_locks_and_another_lock_behind_it_still_holds(tmp_path: Path) -> None:
    robot, switch = KeyedRobot(), tmp_path / "lockout"
    settings = BridgeSettings(port=0, lockout_file=switch)
    async with Bridge(robot, settings) as bridge, operator(bridge) as driver:
        assert not driver.feedback.stop.stopped
        switch.write_text("")
        await driver.heard(lambda feedback: str(switch) in feedback.stop.locked_out)
        robot.key = "key switch"
        await driver.heard(lambda feedback: "key switch" in feedback.stop.locked_out)
        number = driver.feedback.stop.number
        switch.unlink()
        await driver.heard(lambda feedback: feedback.stop.locked_out == "key switch")
        assert driver.feedback.stop.number == number, "one lock-out is one stop"


async def test_a_bridge_starts_locked_while_the_file_is_there_or_its_folder_is_not(tmp_path: Path) -> None:
    (tmp_path / "lockout").write_text("")
    for file in (tmp_path / "lockout", tmp_path / "missing" / "lockout"):
        settings = BridgeSettings(port=0, lockout_file=file)
        async with Bridge(RecordingRobot(), settings) as bridge, operator(bridge, armed=False) as driver:
            await driver.heard(lambda feedback: bool(feedback.stop.locked_out))
            assert driver.feedback.stop.stopped
