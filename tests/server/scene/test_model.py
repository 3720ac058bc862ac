"""A robot in viser, built from its description and posed from feedback."""

import math
from collections.abc import Iterator

import msgspec
import pytest
import rich
import viser

from lockstep.protocol.description import Axis, Body, BodyJoint, Geom, Joint, RangeRing, RobotDescription, WrenchSensor
from lockstep.protocol.description import Pose as ToolPose
from lockstep.protocol.messages import Feedback, StopState
from lockstep.server.scene.kinematics import Pose, world_poses
from lockstep.server.scene.model import SceneModel, length_words

Z = (0.0, 0.0, 1.0)
ROBOT = RobotDescription(
    name="r",
    label="R",
    axes=(),
    joints=(Joint(name="turn", unit="rad"), Joint(name="lift", unit="m")),
    bodies=(
        Body(name="room", parent="", position=(1.0, 0.0, 0.0), geoms=(Geom(shape="box", size=(1, 2, 3)),)),
        Body(
            name="arm",
            parent="",
            joints=(
                BodyJoint(joint="turn", kind="revolute", axis=Z),
                BodyJoint(joint="lift", kind="prismatic", axis=Z),
            ),
            geoms=(
                Geom(shape="sphere", size=(0.1, 0, 0)),
                Geom(shape="cylinder", size=(0.1, 0.5, 0)),
                Geom(shape="capsule", size=(0.1, 0.5, 0), rgba=(1, 0, 0, 0.5)),
                Geom(shape="mesh", vertices=(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1), triangles=(0, 1, 2, 0, 3, 1)),
            ),
        ),
    ),
    wrench=WrenchSensor(name="w", body="arm", threshold_force=1, full_scale_force=10, full_scale_torque=1),
    ranges=RangeRing(
        name="ring", body="arm", count=3, angle_min=0.0, angle_increment=1.0, range_min=0.1, range_max=5.0
    ),
)


def goal_axis(name: str) -> Axis:
    return Axis(name=name, label=name, unit="m", minimum=-9, maximum=9, slew=1, brake=1, kind="goal")


TOOL_ROBOT = msgspec.structs.replace(
    ROBOT,
    axes=tuple(map(goal_axis, "xyz")),
    poses=(ToolPose(name="tool", label="Tool", body="arm", point=(0.1, 0.0, 0.0), position=("x", "y", "z")),),
)


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    rich.get_console().quiet = True
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


def _feedback(**values: object) -> Feedback:
    return Feedback(**{"event": 7, "issue": 1, "time": 0.0, "axes": [], "joints": [0.0, 0.0], **values})  # type: ignore[arg-type]


def test_bodies_move_with_their_joints(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    model.pose(_feedback(joints=[0.0, 0.75]))
    assert tuple(model.frames["arm"].position) == pytest.approx((0, 0, 0.75))
    assert tuple(model.frames["room"].position) == pytest.approx((1, 0, 0))


def test_the_label_shows_the_event_and_the_stop(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    texts = []
    for feedback in (_feedback(), _feedback(event=8, stop=StopState(stopped=True))):
        model.pose(feedback)
        texts.append(model.label.text)
    assert texts == ["s 7", "s 8 · STOPPED"]


def test_a_force_is_an_arrow_and_a_small_one_is_none(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    assert model.arrow is not None
    model.pose(_feedback(wrench=[0.0, 10.0, 0.0, 0.0, 0.0, 0.0]))
    shown = [model.arrow.visible]
    # From the body's surface: inside it nobody would see it.
    assert tuple(model.arrow.points[0, 0]) == pytest.approx((0, 0.1, 0))
    assert tuple(model.arrow.points[0, 1]) == pytest.approx((0, 0.7, 0))
    for wrench in ([0.5, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0] * 6, []):
        model.pose(_feedback(wrench=wrench))
        shown.append(model.arrow.visible)
    assert shown == [True, False, False, False]


def test_what_the_ring_sees_are_points_and_nothing_seen_is_none(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    assert model.points is not None
    model.pose(_feedback(ranges=[2.0, 5.0, 0.01]))
    shown = [model.points.visible]
    assert model.points.points.shape == (1, 3)
    model.pose(_feedback(ranges=[5.0, 5.0, 5.0]))
    shown.append(model.points.visible)
    assert shown == [True, False]


def test_every_ray_of_the_ring_ends_at_what_it_sees(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    assert model.rays is not None
    model.pose(_feedback(ranges=[2.0, 5.0, 1.0]))
    assert model.rays.points.shape == (2, 2, 3)
    assert tuple(model.rays.points[0, 1]) == pytest.approx((2.0, 0.0, 0.0))
    model.pose(_feedback(ranges=[5.0, 5.0, 5.0]))
    assert not model.rays.visible


def test_the_ghost_stands_where_the_commands_lead_and_only_then(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    turned = Pose((0.0, 0.0, 0.9), (1.0, 0.0, 0.0, 0.0))
    shown = [model.ghost.visible]
    model.pose(_feedback(), {"room": turned, "arm": turned})
    shown.append(model.ghost.visible)
    assert model.ghost.label.text == "commanded, last 0.3 s"
    model.pose(_feedback())
    shown.append(model.ghost.visible)
    same = world_poses(ROBOT, {"turn": 0.0, "lift": 1e-4})
    model.pose(_feedback(), same)
    shown.append(model.ghost.visible)
    model.pose(_feedback(), world_poses(ROBOT, {"turn": 0.2, "lift": 0.0}))
    shown.append(model.ghost.visible)
    assert shown == [False, True, False, False, True]


def test_the_trail_follows_what_moves_and_stays_bounded(server: viser.ViserServer) -> None:
    model = SceneModel(server, ROBOT)
    model.pose(_feedback())
    model.pose(_feedback(joints=[0.0, 1e-6]))  # less than a step
    assert model.trails.lengths() == [1]
    for step in range(1, 700):
        model.pose(_feedback(joints=[0.0, step * 0.1]))
    assert 400 < model.trails.lengths()[0] <= 16 * 32


def test_the_event_comes_before_what_belongs_to_it(server: viser.ViserServer) -> None:
    """Viewers hold back what follows an event, so nothing of a pose may come before its event."""
    model = SceneModel(server, ROBOT)
    model.pose(_feedback())
    buffer = server._websock_server._broadcast_buffer
    before = buffer.message_counter
    model.pose(_feedback(event=8, joints=[0.5, 0.5], wrench=[9.0] * 6, ranges=[1.0] * 3))
    new = [message for number, message in sorted(buffer.message_from_id.items()) if number >= before]
    assert getattr(new[0], "updates", None) == {"text": "s 8"}
    assert len(new) < 128  # viser's largest window: a pose stays in one


@pytest.mark.parametrize(
    ("metres", "words"), [(0.5, "0.5 m"), (0.05, "50 mm"), (5e-4, "0.5 mm"), (5e-6, "5 µm"), (5e-8, "50 nm")]
)
def test_the_grid_says_how_large_its_squares_are(metres: float, words: str) -> None:
    assert length_words(metres) == words


@pytest.mark.parametrize(
    "robot",
    [
        RobotDescription(name="r", label="R", axes=()),
        RobotDescription(name="r", label="R", axes=(), bodies=(Body(name="a", parent=""),)),
        RobotDescription(
            name="r",
            label="R",
            axes=(),
            wrench=WrenchSensor(name="w", body="?", threshold_force=1, full_scale_force=1, full_scale_torque=1),
            ranges=RangeRing(name="q", body="?", count=1, angle_min=0, angle_increment=0, range_min=0, range_max=1),
        ),
    ],
)
def test_a_robot_that_describes_little_is_shown_as_far_as_it_goes(
    server: viser.ViserServer, robot: RobotDescription
) -> None:
    SceneModel(server, robot).pose(_feedback(wrench=[1.0] * 6, ranges=[0.5]))


@pytest.mark.parametrize(("size", "nearest", "furthest"), [(0.25, 0.5, 1.5), (5.0, 5.0, 12.0)])
def test_the_first_view_of_an_arm_on_a_table_is_from_near(
    server: viser.ViserServer, size: float, nearest: float, furthest: float
) -> None:
    turning = BodyJoint(joint="turn", kind="revolute", axis=Z)
    arm = (
        Body(name="foot", parent=""),
        Body(name="upper", parent="foot", position=(size, 0.0, 0.0), joints=(turning,)),
    )
    SceneModel(server, RobotDescription(name="r", label="R", axes=(), joints=ROBOT.joints, bodies=arm))
    camera = server.initial_camera
    away = math.dist(camera.position, camera.look_at)
    assert nearest < away < furthest


def test_the_event_stands_above_a_body_whose_own_frame_is_turned_over(server: viser.ViserServer) -> None:
    turned = Body(
        name="arm",
        parent="",
        position=(0.1, 0.0, 0.2),
        orientation=(0.0, 1.0, 0.0, 0.0),  # half a turn about x
        joints=(BodyJoint(joint="turn", kind="revolute", axis=Z),),
    )
    robot = RobotDescription(name="r", label="R", axes=(), joints=ROBOT.joints, bodies=(turned,))
    x, y, z = SceneModel(server, robot).label.position
    assert (x, y) == pytest.approx((0.0, 0.0))
    assert z < 0  # down in the body's frame is up


def test_a_tool_has_its_frame_as_measured_and_its_goal_while_that_is_somewhere_else(server: viser.ViserServer) -> None:
    model = SceneModel(server, TOOL_ROBOT)
    _, measured, goal = model.tools.frames[0]
    model.pose(_feedback(joints=[math.pi / 2, 0.5], goals=[0.3, 0.2, 0.1]))
    assert (measured.visible, goal.visible) == (True, True)
    assert tuple(measured.position) == pytest.approx((0.0, 0.1, 0.5))
    assert tuple(goal.position) == pytest.approx((0.3, 0.2, 0.1))
    model.pose(_feedback(joints=[0.0, 0.5], goals=[0.1, 0.0, 0.501]))
    assert (measured.visible, goal.visible) == (True, False)
    model.pose(_feedback(joints=[0.0, 0.5], goals=[0.3, 0.2, 0.1], unknown=["turn"]))
    assert (measured.visible, goal.visible) == (False, False)


def test_a_shadow_has_its_tool_where_it_wants_it_and_a_pale_arm_with_its_name(server: viser.ViserServer) -> None:
    model = SceneModel(server, TOOL_ROBOT)
    model.pose(_feedback(joints=[0.0, 0.5]))
    assert model.shadows.drawn == []
    wanted = world_poses(TOOL_ROBOT, {"turn": math.pi / 2, "lift": 0.7})
    model.pose(_feedback(joints=[0.0, 0.5]), None, [("act 3", wanted)] * 5)
    first = model.shadows.drawn[0]
    ((_, frame, name),) = first.tools
    assert len(model.shadows.drawn) == 3
    assert (first.root.visible, frame.visible, first.arm.visible) == (True, True, True)
    assert tuple(frame.position) == pytest.approx((0.0, 0.1, 0.7))
    assert name.text == "act 3 (shadow)"
    model.pose(_feedback(joints=[math.pi / 2, 0.7]), None, [("act 3", wanted)])
    assert not first.arm.visible, "it would cover the arm"
    assert [each.root.visible for each in model.shadows.drawn] == [True, False, False]
    model.pose(_feedback(joints=[0.0, 0.5]))
    assert not first.root.visible
