"""Tools of arms with a spherical wrist and with a joint to spare, driven through the bridge's shaping of goals."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.robot_bridge.errors import ModelError
from tests.robot_bridge.robots.mjcf.tools.arms import SEVEN_JOINTS, SIX_JOINTS, arm_model
from tests.robot_bridge.robots.mjcf.tools.test_tool_setting import SETTING
from tests.robot_bridge.robots.mjcf.tools.world import HOLD, World, parts_in

ARMS = {6: arm_model(SIX_JOINTS), 7: arm_model(SEVEN_JOINTS)}
WORDS = ("x", "y", "z", "rx", "ry", "rz")
few = settings(max_examples=10)  # an example is hundreds of steps
both = pytest.mark.parametrize("joints", [6, 7])

offsets = st.tuples(*[st.floats(-0.25, 0.25)] * 7)
ways = st.tuples(*[st.floats(-0.5, 0.5)] * 3, *[st.floats(-2.5, 2.5)] * 3)


def goals(world: World, values: tuple[float, ...]) -> dict[str, float]:
    return {f"grip.{word}": value for word, value in zip(WORDS, values, strict=True)}


def moved(world: World, ways: tuple[float, ...]) -> dict[str, float]:
    """Where the tool is, and some way further."""
    return goals(world, tuple(world.value(word) + way for word, way in zip(WORDS, ways, strict=True)))


@both
def test_a_tool_has_six_axes_instead_of_its_joints_and_its_rotation_begins_at_zero(joints: int) -> None:
    parts, axes = parts_in(ARMS[joints])
    assert parts.pose.position == ("grip.x", "grip.y", "grip.z")
    assert parts.pose.rotation == ("grip.rx", "grip.ry", "grip.rz")
    assert parts.pose.instead_of == tuple(axis.name for axis in axes[:joints])
    assert {axis.kind for axis in axes if axis.name != "gripper"} == {"goal"}
    assert World(ARMS[joints]).pursued()[-3:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert any(binding.axis == "gripper" for binding in parts.layer.bindings)


@both
@few
@given(off=offsets)
def test_a_pose_that_the_arm_can_have_is_reached(joints: int, off: tuple[float, ...]) -> None:
    world, there = World(ARMS[joints]), World(ARMS[joints])
    posture = np.add(there.tool.goals, off[:joints])
    wanted = goals(world, tuple(there.tool.pose_at(posture.tolist())))
    world.approach(wanted, 60)
    position = [wanted[f"grip.{word}"] - world.value(word) for word in "xyz"]
    assert math.hypot(*position) < 2e-3
    assert [world.value(word) for word in WORDS[3:]] == pytest.approx(
        [wanted[f"grip.{w}"] for w in WORDS[3:]], abs=0.02
    )


@pytest.mark.slow
@both
@few
@given(way=ways, events=st.integers(1, 25))
def test_towards_any_pose_no_joint_leaves_its_range_or_jumps_and_all_rest_within_hold(
    joints: int, way: tuple[float, ...], events: int
) -> None:
    world = World(ARMS[joints])
    world.command(moved(world, way), events)
    world.wait(HOLD)
    rest = world.tool.goals
    world.wait(0.2)
    assert world.tool.goals == rest
    assert world.fastest_change() < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [0.0, 0.05, 0.3])
def test_a_tool_turns_past_the_singularity_of_a_spherical_wrist(yaw: float) -> None:
    """Roll and twist have one axis where the bend is straight: no speed of theirs turns the tool about the other."""
    world = World(ARMS[6])
    place = [world.value("x") + 0.2, world.value("y"), world.value("z") + 0.2]  # where the arm has room
    world.approach(goals(world, (*place, 0.0, 0.0, 0.0)), 60)
    for step in range(150):
        world.command(goals(world, (*place, 0.0, -0.01 * step, yaw)))
    world.approach(goals(world, (*place, 0.0, -1.5, yaw)), 60)
    bend, roll = (np.array(world.way)[:, number] for number in (4, 3))
    assert bend[-1] < -0.5 or abs(roll[-1]) > 1.5  # straight through, or round it
    assert world.fastest_change() < 0.4
    assert [world.value(word) for word in "xyz"] == pytest.approx(place, abs=0.01)
    assert [world.value(word) for word in WORDS[3:]] == pytest.approx((0.0, -1.5, yaw), abs=0.05)


@pytest.mark.slow
@both
def test_an_arm_goes_out_of_its_reach_and_in_again_without_a_jump(joints: int) -> None:
    world = World(ARMS[joints])
    begun = [world.value(word) for word in WORDS]
    way = [0.008, 0.003, 0.005, 0.0, 0.0, 0.0]
    for step in [*range(110), *reversed(range(110))]:
        world.command(goals(world, tuple(np.add(begun, np.multiply(way, step)).tolist())))
    assert world.fastest_change() < 0.4
    world.approach(goals(world, tuple(begun)), 40)
    assert [world.value(word) for word in "xyz"] == pytest.approx(begun[:3], abs=5e-3)


@pytest.mark.slow
def test_a_joint_to_spare_comes_back_where_the_tool_does() -> None:
    """Without the pull of the posture, the joints are up to 0.7 rad away after two circles."""
    world = World(ARMS[7])
    begun, joints = [world.value(word) for word in WORDS], world.tool.goals
    for step in range(200):
        angle = step * math.tau / 100
        circle = (0.1 * (math.cos(angle) - 1), 0.1 * math.sin(angle), 0.0, 0.0, 0.0, 0.0)
        world.command(goals(world, tuple(np.add(begun, circle).tolist())))
    world.approach(goals(world, tuple(begun)), 60)
    assert world.tool.goals == pytest.approx(joints, abs=0.1)


def test_joints_and_tool_take_turns_and_nothing_moves_at_the_change() -> None:
    world = World(ARMS[6])
    world.command({"waist": 0.3}, 20)
    world.wait(HOLD)
    assert world.tool.goals[0] == pytest.approx(0.3)
    here = [world.value(word) for word in WORDS]
    before = world.tool.goals
    world.command(goals(world, tuple(here)), 5)
    world.wait(HOLD)
    assert world.tool.goals == pytest.approx(before, abs=1e-6)
    world.command({"grip.z": here[2] + 0.05}, 30)
    assert world.value("z") == pytest.approx(here[2] + 0.05, abs=2e-3)


def test_parts_of_the_arm_keep_off_each_other() -> None:
    """The tool is led into the arm's own base."""
    world = World(ARMS[6])
    begun = [world.value(word) for word in WORDS]
    for step in range(100):
        world.command(goals(world, (begun[0] - 0.006 * step, begun[1], begun[2] - 0.004 * step, *begun[3:])))
    assert "the arm is close to itself" in world.tool.faults
    model: Any = mujoco.MjModel.from_xml_string(ARMS[6])
    data: Any = mujoco.MjData(model)
    for joints in world.way[::10]:
        data.qpos[:6] = joints
        mujoco.mj_forward(model, data)
        touching = {tuple(model.geom_bodyid[pair].tolist()) for pair in data.contact.geom}
        assert {pair for pair in touching if 0 not in pair} == set()  # 0: the floor


def test_an_arm_on_a_base_that_moves_has_its_pose_in_the_bases_frame() -> None:
    slide = '<joint name="rail" type="slide" axis="1 0 0" range="-1 1"/>'
    parts, _ = parts_in(arm_model(SIX_JOINTS, base=slide))
    fixed, _ = parts_in(ARMS[6])
    assert (parts.pose.frame, fixed.pose.frame) == ("base", "")
    home = parts.tool.goals
    assert np.subtract(fixed.tool.pose_at(home), parts.tool.pose_at(home))[:3] == pytest.approx((0.1, 0.2, 0.0))


SEEN = SETTING.format("grip@overview")


def in_camera(text: str, joints: tuple[float, ...]) -> tuple[float, ...]:
    """Return where the grip is for the model's camera: right, down and ahead of it, as MuJoCo has it."""
    model: Any = mujoco.MjModel.from_xml_string(text)
    data: Any = mujoco.MjData(model)
    for name, value in zip([name for name, *_ in SIX_JOINTS], joints, strict=True):
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    camera = data.camera("overview")
    right, up, behind = (data.site("grip").xpos - camera.xpos) @ camera.xmat.reshape(3, 3)
    return right, -up, -behind


def test_a_tool_in_a_cameras_frame_moves_as_seen_in_its_picture() -> None:
    world = World(arm_model(more=SEEN))
    assert world.parts.pose.frame == "overview"
    begun = [world.value(word) for word in WORDS]
    assert begun == pytest.approx([*in_camera(ARMS[6], world.tool.goals), 0.0, 0.0, 0.0], abs=1e-5)
    for way in ((0.1, 0.0, 0.0), (0.0, -0.1, 0.0), (0.0, 0.0, -0.1)):
        there = tuple(np.add(begun[:3], way).tolist())
        world.approach(goals(world, (*there, 0.0, 0.0, 0.0)), 40)
        assert in_camera(ARMS[6], world.tool.goals) == pytest.approx(there, abs=3e-3)
    assert world.fastest_change() < 0.4


def test_a_stick_moves_a_tool_in_a_cameras_frame_right_and_up_in_the_picture() -> None:
    parts, axes = parts_in(arm_model(more=SEEN))
    assert [axis.label for axis in axes[-6:]] == [
        *("Grip right", "Grip down", "Grip away"),
        *("Grip pitch up", "Grip yaw right", "Grip roll clockwise"),
    ]
    keys = {each.axis: (each.key_positive, each.key_negative) for each in parts.layer.bindings}
    assert [keys[f"grip.{word}"] for word in WORDS] == [
        *(("KeyD", "KeyA"), ("KeyS", "KeyW"), ("KeyR", "KeyF")),
        *(("ArrowUp", "ArrowDown"), ("ArrowRight", "ArrowLeft"), ("KeyE", "KeyQ")),
    ]
    # A pad gives right and down as positive, a touch stick right and up.
    sticks = {each.axis: (each.pad, each.invert_pad, each.invert_touch) for each in parts.layer.bindings}
    assert [sticks[f"grip.{word}"] for word in WORDS] == [
        *(("left_x", False, False), ("left_y", False, True), ("right_y", True, False)),
        *(("dpad_y", True, False), ("dpad_x", False, False), ("right_x", False, False)),
    ]


def test_a_camera_on_a_base_that_moves_has_the_pose_of_an_arm_there() -> None:
    rail = '<joint name="rail" type="slide" axis="1 0 0" range="-1 1"/>'
    text = arm_model(base=rail, more=SEEN)
    camera = text[text.index("<camera") : text.index("/>", text.index("<camera")) + 2]
    carried = text.replace(camera, "").replace(rail, rail + camera)
    with pytest.raises(ModelError, match="the world does not stand on base"):
        parts_in(text)
    parts, _ = parts_in(carried)
    home = parts.tool.goals
    assert parts.tool.pose_at(home)[:3] == pytest.approx(in_camera(carried, home), abs=1e-5)


def test_the_floor_is_kept_off_in_a_cameras_frame_too() -> None:
    text = arm_model(more=SEEN.replace("</custom>", '<text name="lockstep_obstacles" data="floor"/></custom>'))
    world = World(text)
    begun = np.array([world.value(word) for word in WORDS])
    down = np.array([*in_world_down(text), 0.0, 0.0, 0.0])
    for step in range(120):
        world.command(goals(world, tuple((begun + 0.01 * step * down).tolist())))
    assert "the arm is close to the floor" in world.tool.faults
    model: Any = mujoco.MjModel.from_xml_string(text)
    data: Any = mujoco.MjData(model)
    for joints in world.way[::10]:
        data.qpos[:6] = joints
        mujoco.mj_forward(model, data)
        assert data.site("grip").xpos[2] > 0.0
        assert model.geom("floor").id not in data.contact.geom


def in_world_down(text: str) -> list[float]:
    """Return the world's way down, for the model's camera."""
    model: Any = mujoco.MjModel.from_xml_string(text)
    data: Any = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    right, up, behind = (np.array([0.0, 0.0, -1.0]) @ data.camera("overview").xmat.reshape(3, 3)).tolist()
    return [right, -up, -behind]
