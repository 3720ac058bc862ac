"""Settings of an arm that is driven by goals: of its joints, and of its tool's pose."""

import math
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.tool import arm_tool

URDF = Path(__file__).parents[3] / "support" / "ros2" / "robot.urdf"
JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
ROWS = "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS)
POSTURE = "[0, -1, 1, 0, 0.5, 0]"


def settings(directory: Path, arm: str, urdf: bool = True, more: str = "", rows: str = ROWS) -> Path:
    path = directory / "robot.yaml"
    beside = f"urdf: {URDF}\n" if urdf else ""
    path.write_text(f"name: arm\n{beside}{more}arm:\n{arm}  joints:\n{rows}")
    return path


def test_joints_are_goal_axes_with_the_ranges_and_speeds_of_the_urdf(tmp_path: Path) -> None:
    _, description = read_settings(settings(tmp_path, "  goals: true\n"))
    axes = {axis.name: axis for axis in description.axes}
    pan, lift, last = (axes[f"arm.{JOINTS[number]}"] for number in (0, 1, 5))
    assert {axis.kind for axis in description.axes} == {"goal"}
    assert (pan.minimum, pan.maximum, pan.slew) == (-3.0, 3.0, 0.75)
    assert lift.slew == pytest.approx(0.15)  # of the 0.2 rad/s in the URDF
    assert (last.wrap, last.reach) == (math.tau, 0.5)  # it is continuous
    assert description.poses == ()


def test_a_tool_has_a_pose_instead_of_its_joints_that_is_zero_in_its_posture(tmp_path: Path) -> None:
    path = settings(tmp_path, f"  tool: {{tip: wrist_3, point: [0, 0, 0.1], posture: {POSTURE}}}\n")
    _, description = read_settings(path)
    (pose,) = description.poses
    assert pose.instead_of == tuple(f"arm.{name}" for name in JOINTS)
    assert (pose.frame, pose.body) == ("", "wrist_3.tool")
    assert [layer.name for layer in description.layers] == ["tool", "arm1", "arm2"]
    chain = Chain(description.bodies, pose.body)
    assert rotation_vector(chain.at((0, -1, 1, 0, 0.5, 0)).rotation) == pytest.approx((0, 0, 0), abs=1e-6)


def test_an_arm_on_a_base_has_its_pose_in_the_bases_frame(tmp_path: Path) -> None:
    base = "base:\n  forward: {maximum: 0.5}\n"
    _, description = read_settings(settings(tmp_path, "  tool: {tip: wrist_3}\n", more=base))
    assert description.poses[0].frame == "base"
    assert [axis.kind for axis in description.axes] == ["rate"] + ["goal"] * 12


VIEW = "fx: 300, fy: 300, cx: 160, cy: 120, position: [-1, 0, 0.5], orientation: [0.5, -0.5, 0.5, -0.5]"
CAMERA = f"cameras:\n  - {{name: front, topic: /c, width: 320, height: 240, calibration: {{{VIEW}}}}}\n"
FRAME = "  tool: {tip: wrist_3, frame: front}\n"


def test_a_tool_in_a_cameras_frame_is_where_the_camera_sees_it(tmp_path: Path) -> None:
    """The camera looks along the world's x, from 1 m behind its origin and 0.5 m above it."""
    joints, zero = [0.3, -1.0, 1.0, 0.2, 0.5, 0.1], [0.0] * 6
    plain, robot = read_settings(settings(tmp_path, "  tool: {tip: wrist_3}\n"))
    assert plain.arm is not None
    x, y, z, *turn = arm_tool(plain.arm, robot, joints).pose_at(joints)
    arm, description = read_settings(settings(tmp_path, FRAME, more=CAMERA))
    assert arm.arm is not None
    assert description.poses[0].frame == "front"
    seen = arm_tool(arm.arm, description, joints).pose_at(joints)
    assert seen == pytest.approx((-y, 0.5 - z, x + 1.0, -turn[1], -turn[2], turn[0]))
    assert arm_tool(arm.arm, description, zero).pose_at(zero)[3:] == pytest.approx((0, 0, 0), abs=1e-6)
    assert [axis.label for axis in description.axes[-6:-3]] == ["Tool right", "Tool down", "Tool away"]


@pytest.mark.parametrize(
    ("arm", "more", "words"),
    [
        (FRAME, "", "arm.tool.frame: there is no camera 'front'"),
        (FRAME, CAMERA.split(", calibration")[0] + "}\n", "the camera 'front' needs a calibration"),
        (FRAME, CAMERA.replace("position:", "body: forearm, position:"), "a joint moves forearm against the world"),
        (FRAME, CAMERA.replace("[0.5, -0.5, 0.5, -0.5]", "[0, 0, 0, 0]"), "is not a rotation"),
        (FRAME.replace("front", "upper_arm"), CAMERA.replace("front", "upper_arm"), "is the name of a body too"),
        ("  tool: {tip: hand}\n", "", "arm.tool.tip: hand does not hang on the world"),
        ("  tool: {tip: upper_arm}\n", "", "between upper_arm and the world are 2 joints of the arm; a pose needs 3"),
        ("  tool: {tip: wrist_3, posture: [0, 1]}\n", "", "needs one value for each of the 6 joints"),
        ("  tool: {tip: wrist_3}\n", "hold: 0.2\n", "a tool needs a hold of 0.27 s at least, not 0.2 s"),
        ("  tool: {tip: wrist_3, obstacles: [{name: the wall, normal: [0, 0, 0]}]}\n", "", "normal: has no direction"),
        ("  tool: {tip: wrist_3, obstacles: [{name: the wall, normal: [0, .nan, 1]}]}\n", "", "normal: needs numbers"),
        ("  tool: {tip: wrist_3, obstacles: [{name: a, position: [.inf, 0, 0]}]}\n", "", "position: needs numbers"),
        ("  goals: true\n  command: {message: Float64MultiArray}\n", "", "goals need positions"),
        ("  goals: true\n", "bodies: [{name: a, parent: ''}]\n", "leave out one of the two"),
    ],
)
def test_what_does_not_fit_is_named_with_its_key(tmp_path: Path, arm: str, more: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        read_settings(settings(tmp_path, arm, more=more))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("{name: thumb, maximum: 1.0}", "the URDF has no joint thumb that moves"),
        ("{name: laser_mount, maximum: 1.0}", "the URDF has no joint laser_mount that moves"),
        ("{name: elbow_joint, unit: m, maximum: 1.0}", "does not fit the unit m"),
    ],
)
def test_a_joint_that_the_urdf_has_not_is_named(tmp_path: Path, row: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        read_settings(settings(tmp_path, "  goals: true\n", rows=f"    - {row}\n"))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("{name: lift, unit: m, maximum: 0.1}", "give lower and upper"),
        ("{name: lift, maximum: 0.1, lower: 0}", "give lower and upper"),
        ("{name: lift, maximum: 0.1, lower: 0, upper: 0.1, margin: 0.1}", "no range is left"),
    ],
)
def test_a_goal_needs_a_range(tmp_path: Path, row: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        read_settings(settings(tmp_path, "  goals: true\n", urdf=False, rows=f"    - {row}\n"))


@pytest.mark.parametrize(
    ("text", "words"), [(None, "No such file"), ("<robot/>", "has no link"), ("x" * ((4 << 20) + 1), "longer than")]
)
def test_a_urdf_that_cannot_be_read_is_named(tmp_path: Path, text: str | None, words: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(f"name: arm\nurdf: own.urdf\narm:\n  goals: true\n  joints:\n{ROWS}")
    if text is not None:
        (tmp_path / "own.urdf").write_text(text)
    with pytest.raises(SettingsError, match=words):
        read_settings(path)


def test_an_arm_keeps_off_the_planes_and_boxes_of_its_settings(tmp_path: Path) -> None:
    ceiling = "{name: the ceiling, position: [0, 0, 1.62], normal: [0, 0, -1]}"
    obstacles = f"[{ceiling}, {{name: the post, position: [9, 0, 0], size: [1, 1, 1]}}]"
    path = settings(
        tmp_path, f"  tool: {{tip: wrist_3, posture: {POSTURE}, keeps: rotation, obstacles: {obstacles}}}\n"
    )
    found, description = read_settings(path)
    assert found.arm is not None
    tool = arm_tool(found.arm, description, (0, -1, 1, 0, 0.5, 0))
    values = [*tool.goals, *tool.pose_at(tool.goals)]
    height = 6 + 2  # z of the tool
    tool.drive(values, 0.01, 0.01)
    faults: set[str] = set()
    for _ in range(300):
        values[height] += 0.002
        tool.drive(values, 0.01, 0.01, pursues=True)
        faults.update(tool.faults)
    assert "the arm is close to the ceiling" in faults
    assert 1.6 < tool.pose_at(tool.goals)[2] < 1.62
