"""`lockstep ros2 discover` on a real graph, and a bridge that drives it by the file as it was written."""

import asyncio
import os
import pty
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.ros2 import read_settings
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.ros2 import (
    EVERYTHING,
    PATIENCE,
    STAY,
    TWO_BASES,
    built_interfaces,
    have_compiler,
    have_ros,
    ros_environment,
    ros_python,
    running_ros_bridge,
    running_ros_robot,
)

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
COMMANDS = ("twist", "trajectory", "joints", "velocities")


async def discover(
    out: Path, environment: dict[str, str], *options: str, interfaces: Path | None = None
) -> tuple[int, str]:
    """Run the command as a user without ROS in their own Python does; its exit status, and all that it printed."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge.robots.ros2.discovery", "discover"),
        *("--out", str(out), "--robot-python", ros_python(), *options),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        env=os.environ
        | {name: value for name, value in environment.items() if name != "PYTHONPATH"}
        | ({} if interfaces is None else {"PYTHONPATH": str(interfaces)}),
    )
    async with asyncio.timeout(2 * PATIENCE):
        output, _ = await process.communicate()
    assert process.returncode is not None
    return process.returncode, output.decode()


async def test_the_file_drives_the_graph_that_it_was_written_from_without_an_edit(tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    async with running_ros_robot(tmp_path) as node:
        code, printed = await discover(out, node.environment)  # without a terminal: nobody is asked
        assert code == 0, printed
        assert f"{out} is written" in printed
        settings, description = read_settings(out)
        assert list(node.notes(*COMMANDS)) == [], "the discovery published a command"
        text = out.read_text()

        assert settings.name == "six-joint-tug"
        assert settings.base is not None
        assert (settings.base.command.topic, settings.base.command.message) == ("/cmd_vel", "TwistStamped")
        assert settings.base.forward.maximum == 0.2
        assert "not /cmd_vel_plain" in text
        assert settings.arm is not None
        assert tuple(joint.name for joint in settings.arm.joints) == JOINTS, "the gripper is not the controller's"
        lift, wrist = settings.arm.joints[1], settings.arm.joints[5]
        assert (lift.maximum, lift.lower, lift.upper) == (0.2, -3.0, 3.0), "slower than the URDF allows"
        assert (wrist.lower, wrist.upper) == (None, None)
        assert settings.ranges is not None
        assert settings.ranges.yaw == pytest.approx(1.5708)
        assert description.ranges is not None
        (scanner,) = (body for body in description.bodies if body.name == description.ranges.body)
        assert (scanner.parent, scanner.position) == ("base", (0.2, 0.0, 0.2))
        assert [(camera.width, camera.height, camera.captured) for camera in settings.cameras] == [
            (320, 240, "header"),
            (320, 240, "header"),
        ]
        assert [body.name for body in description.bodies][:3] == ["base", "base_link", "shoulder"]
        assert "wrist_3" in text, "a link that is not drawn is named"

        async with (
            running_ros_bridge(tmp_path, node, out) as bridge,
            RobotLink(*bridge.address, "operator", name="test") as link,
        ):
            driver = Operator(link)
            await driver.next(Feedback)
            async with asyncio.timeout(2 * PATIENCE):
                await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [])
                await driver.arm()
                while driver.feedback.joints[0] < 0.02 or driver.feedback.joints[3] < 0.02:
                    await driver.drive([0.2, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
                await driver.heard(lambda feedback: feedback.at_rest)
            await node.noted("twist", lambda twists: twists[-1]["values"] == STAY)

        code, printed = await discover(out, node.environment)
        assert (code, "is there already" in printed) == (2, True)
        assert out.read_text() == text


async def discover_at_terminal(
    out: Path, environment: dict[str, str], answer: Callable[[str], str]
) -> tuple[int, list[str]]:
    """Run the command at a terminal. `answer` is told each question. Its exit status, and the questions."""
    master, slave = pty.openpty()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.robot_bridge.robots.ros2.discovery", "discover"),
        *("--out", str(out), "--robot-python", ros_python()),
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env=os.environ | {name: value for name, value in environment.items() if name != "PYTHONPATH"},
        start_new_session=True,
    )
    os.close(slave)
    said, asked = "", list[str]()

    def read() -> None:
        nonlocal said
        try:
            said += os.read(master, 4096).decode(errors="replace")
        except OSError:  # the command has ended
            asyncio.get_running_loop().remove_reader(master)
            return
        if said.endswith("]: "):
            asked.append(said.splitlines()[-1])
            os.write(master, f"{answer(asked[-1])}\n".encode())
            said += "\n"

    asyncio.get_running_loop().add_reader(master, read)
    try:
        async with asyncio.timeout(2 * PATIENCE):
            code = await process.wait()
    finally:
        asyncio.get_running_loop().remove_reader(master)
        os.close(master)
    return code, asked


async def test_a_person_at_a_terminal_is_asked_what_the_graph_does_not_say(tmp_path: Path) -> None:
    out, guessed = tmp_path / "robot.yaml", tmp_path / "guessed.yaml"
    async with running_ros_robot(tmp_path) as node:
        code, asked = await discover_at_terminal(
            out, node.environment, lambda question: "0.15" if "m/s" in question else ""
        )
        assert code == 0, asked
        assert asked
        assert (await discover(guessed, node.environment))[0] == 0
    speeds = [question for question in asked if "m/s" in question]
    settings, _ = read_settings(out)
    assert settings.base is not None
    assert len(speeds) >= 1, asked
    assert settings.base.forward.maximum == 0.15
    assert out.read_text().count("CHECK") < guessed.read_text().count("CHECK"), "what a person has said is no guess"


@pytest.mark.skipif(not have_compiler(), reason="there is no compiler for the interfaces that no wheel has")
@pytest.mark.timeout(180)
async def test_what_moves_the_robot_stands_in_the_file_switched_off_and_works_when_it_is_switched_on(
    tmp_path: Path,
) -> None:
    out, interfaces = tmp_path / "robot.yaml", built_interfaces()
    async with running_ros_robot(tmp_path, EVERYTHING, interfaces=interfaces) as node:
        code, printed = await discover(out, node.environment, "--yes", interfaces=interfaces)
        assert code == 0, printed
        settings, description = read_settings(out)
        assert (settings.services, settings.actions, settings.grippers) == ((), (), ()), "nobody was asked"
        assert description.actions == ()
        assert "switched off: beep, calibrate, light" in printed
        assert settings.map is not None
        assert (settings.map.topic, settings.map.durable, settings.map.frame) == ("/map", True, "map")
        assert (settings.map.place.source, settings.map.place.odometry, settings.map.path) == ("tf", "odom", "/plan")
        assert settings.map.goal is None
        assert [battery.topic for battery in settings.batteries] == ["/battery_state"]
        assert settings.diagnostics is not None
        front = next(camera for camera in settings.cameras if camera.topic == "/camera/image_raw")
        assert front.calibration is not None
        assert (front.calibration.fx, front.calibration.fy, front.calibration.cx) == (250.0, 255.0, 160.0)
        assert (front.calibration.body, front.calibration.position) == ("base_link", (0.25, 0.0, 0.3))
        assert description.cameras[0].calibration == front.calibration

        written = "\n".join(line.removeprefix("# ") if _is_off(line) else line for line in out.read_text().splitlines())
        out.write_text(written)
        settings, description = read_settings(out)
        assert {each.name: each.moves for each in description.actions} == {
            **{"beep": False, "calibrate": False, "light": False},
            **{"count": True, "late": True, "gripper": True, "go_to": True},
        }
        async with (
            running_ros_bridge(tmp_path, node, out) as bridge,
            RobotLink(*bridge.address, "operator", name="test") as link,
        ):
            driver = Operator(link)
            await driver.next(Feedback)
            async with asyncio.timeout(2 * PATIENCE):
                await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [])
                await driver.arm()
                said, tries = "nobody offers", 0
                while said.startswith("nobody offers"):  # the service has not been found yet
                    tries += 1
                    link.send(Act(id=f"{tries:016x}", name="beep", nonce=driver.feedback.nonce))
                    update = await driver.next(ActionUpdate)
                    while update.state == "running":
                        update = await driver.next(ActionUpdate)
                    said = update.text
                assert list(node.notes("beep")), said


def _is_off(line: str) -> bool:
    """Whether a line of the file is a setting that stands in it as a comment."""
    words = ("# services:", "# actions:", "# grippers:", "#   - {", "#   goal:")
    return line.startswith(words)


async def test_one_of_several_robots_is_named_and_only_that_one_is_driven(tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    async with running_ros_robot(tmp_path, TWO_BASES) as node:
        code, printed = await discover(out, node.environment, "--yes")
        assert code == 1
        assert "there are several robots: /robot1, /robot2" in printed
        code, printed = await discover(out, node.environment, "--yes", "--namespace", "/robot2")
        assert code == 0, printed
        async with (
            running_ros_bridge(tmp_path, node, out) as bridge,
            RobotLink(*bridge.address, "operator", name="test") as link,
        ):
            driver = Operator(link)
            await driver.next(Feedback)
            async with asyncio.timeout(2 * PATIENCE):
                await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [])
                await driver.arm()
                while driver.feedback.joints[0] < 0.02:
                    await driver.drive([0.2, 0.0])
                await driver.heard(lambda feedback: feedback.at_rest)
            twists = await node.noted("twist", lambda twists: twists[-1]["values"] == STAY)
    assert {twist["robot"] for twist in twists} == {"robot2"}


async def test_an_empty_graph_is_named_with_what_to_check(tmp_path: Path) -> None:
    out = tmp_path / "robot.yaml"
    code, printed = await discover(out, ros_environment(), "--yes", "--seconds", "1")
    assert code == 1
    assert "ROS_DOMAIN_ID" in printed
    assert "RMW_IMPLEMENTATION" in printed
    assert not out.exists()


async def test_a_robot_that_is_not_there_is_named_with_what_is(tmp_path: Path) -> None:
    async with running_ros_robot(tmp_path) as node:
        options = ("--namespace", "/robot7", "--yes", "--seconds", "1")
        code, printed = await discover(tmp_path / "robot.yaml", node.environment, *options)
    assert code == 1
    assert "there is nothing to drive below /robot7" in printed
