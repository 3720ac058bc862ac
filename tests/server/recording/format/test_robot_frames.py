"""The frames that 3D views get are those of the kinematics, whatever robot it is."""

import msgspec
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration as CalibrationMessage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Pose_pb2 import Pose as PoseMessage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from lockstep.protocol.description import (
    Axis,
    Body,
    BodyJoint,
    Camera,
    CameraCalibration,
    Geom,
    Joint,
    PlanarBase,
    RobotDescription,
)
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.server.recording.format.robot_frames import (
    WORLD,
    camera_calibration,
    fixed_transforms,
    moving_transforms,
    odometry,
    robot_shapes,
)
from lockstep.server.scene.kinematics import Pose, joined, rotate, world_poses

AT = 1_800_000_000_123_456_789
TURNED = (0.7071067811865476, 0.0, 0.7071067811865476, 0.0)  # 90 degrees about y: z becomes x


def robot(*bodies: Body, base: PlanarBase | None = None) -> RobotDescription:
    axes = tuple(
        Axis(name=name, label=name, unit="m/s", minimum=-1.0, maximum=1.0, slew=1.0, brake=1.0)
        for name in ("f", "l", "t")
    )
    joints = tuple(Joint(name=name, unit="m") for name in ("x", "y", "yaw"))
    return RobotDescription(name="r", label="R", axes=axes, joints=joints, bodies=bodies, planar_base=base)


def frames(message: bytes) -> dict[str, tuple[str, Pose]]:
    found = {}
    for each in FrameTransforms.FromString(message).transforms:
        at, turn = each.translation, each.rotation
        pose = Pose((at.x, at.y, at.z), (turn.w, turn.x, turn.y, turn.z))
        found[each.child_frame_id] = (each.parent_frame_id, pose)
        assert each.timestamp.seconds * 1_000_000_000 + each.timestamp.nanos == AT
    return found


@pytest.mark.parametrize("name", ["planar", "mobile-manipulator"])
def test_transforms_lead_from_the_world_to_where_the_kinematics_put_each_body(name: str) -> None:
    description = create_robot(name).describe()
    joints = {joint.name: 0.1 + 0.2 * number for number, joint in enumerate(description.joints)}
    moving, fixed = frames(moving_transforms(description, joints, AT)), frames(fixed_transforms(description, AT))
    assert not moving.keys() & fixed.keys()
    cameras = {camera.name for camera in description.cameras if camera.calibration is not None}
    assert cameras
    tree = moving | fixed
    assert cameras == tree.keys() - {body.name for body in description.bodies}

    def in_world(body: str) -> Pose:
        parent, pose = tree[body]
        return pose if parent == WORLD else joined(in_world(parent), pose)

    for body, expected in world_poses(description, joints).items():
        found = in_world(body)
        assert found.position == pytest.approx(expected.position)
        assert found.orientation == pytest.approx(expected.orientation)


def test_a_camera_whose_place_is_known_is_a_frame_where_it_looks_along_z() -> None:
    ahead = CameraCalibration(
        fx=200.0,
        fy=210.0,
        cx=160.0,
        cy=120.0,
        body="base",
        position=(0.1, 0.0, 0.5),
        orientation=(0.5, -0.5, 0.5, -0.5),
    )
    camera = Camera(name="front", label="F", width=320, height=240, frame_rate=15.0, calibration=ahead)
    blind = Camera(name="blind", label="B", width=320, height=240, frame_rate=15.0)
    named = msgspec.structs.replace(camera, name="base")  # a body's name: the body goes first
    base = Body(name="base", parent="")
    description = msgspec.structs.replace(robot(base), cameras=(camera, blind, named))
    found = frames(fixed_transforms(description, AT))
    assert set(found) == {"base", "front"}
    assert found["front"] == ("base", Pose(ahead.position, ahead.orientation))
    assert rotate(ahead.orientation, (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    message = CalibrationMessage.FromString(camera_calibration(camera, ahead, AT))
    assert (message.frame_id, message.width, message.height) == ("front", 320, 240)
    assert list(message.K) == [200.0, 0.0, 160.0, 0.0, 210.0, 120.0, 0.0, 0.0, 1.0]
    assert list(message.P) == [200.0, 0.0, 160.0, 0.0, 0.0, 210.0, 120.0, 0.0, 0.0, 0.0, 1.0, 0.0]


def test_a_body_that_is_called_as_the_root_is_not_a_frame_in_itself() -> None:
    assert frames(fixed_transforms(robot(Body(name=WORLD, parent=""), Body(name="lamp", parent=WORLD)), AT)) == {
        "lamp": (WORLD, Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    }


def test_shapes_are_whole_sizes_in_the_frame_of_their_body_and_replace_those_before() -> None:
    geoms = (
        Geom(shape="box", size=(1.0, 2.0, 3.0), rgba=(0.1, 0.2, 0.3, 0.5)),
        Geom(shape="sphere", size=(0.5, 0.0, 0.0), position=(1.0, 0.0, 0.0)),
        Geom(shape="cylinder", size=(0.5, 2.0, 0.0)),
        Geom(shape="capsule", size=(0.25, 1.0, 0.0), orientation=TURNED),
        Geom(shape="mesh", vertices=(0, 0, 0, 1, 0, 0, 0, 2, 0), triangles=(0, 1, 2), position=(0.0, 0.0, 4.0)),
    )
    update = SceneUpdate.FromString(
        robot_shapes(robot(Body(name="base", parent="", geoms=geoms), Body(name="bare", parent="base")), AT)
    )
    (deletion,), (entity,) = update.deletions, update.entities
    assert deletion.type == deletion.ALL
    assert (entity.id, entity.frame_id, entity.frame_locked) == ("base", "base", True)
    (cube,), spheres, (cylinder, tube) = entity.cubes, entity.spheres, entity.cylinders
    assert (cube.size.x, cube.size.y, cube.size.z) == (2.0, 4.0, 6.0)
    assert (cube.color.r, cube.color.a) == pytest.approx((0.1, 0.5))
    assert (spheres[0].size.x, spheres[0].pose.position.x) == (1.0, 1.0)
    assert (cylinder.size.x, cylinder.size.z, cylinder.top_scale, cylinder.bottom_scale) == (1.0, 4.0, 1.0, 1.0)
    assert (tube.size.x, tube.size.z) == (0.5, 2.0)
    assert sorted(each.pose.position.x for each in spheres[1:]) == pytest.approx([-1.0, 1.0])
    (mesh,) = entity.triangles
    assert [(point.x, point.y, point.z) for point in mesh.points] == [(0, 0, 0), (1, 0, 0), (0, 2, 0)]
    assert (list(mesh.indices), mesh.pose.position.z) == ([0, 1, 2], 4.0)


def test_odometry_has_the_measured_twist_in_the_frame_of_the_body_that_turns() -> None:
    base = PlanarBase(x="x", y="y", yaw="yaw", forward="f", left="l", turn="t")
    joints = tuple(BodyJoint(joint=name, kind="prismatic", axis=(1.0, 0.0, 0.0)) for name in ("x", "y", "yaw"))
    description = robot(Body(name="chassis", parent="", joints=joints), base=base)
    found = Odometry.FromString(odometry(description, base, PoseMessage(), [0.5, -0.25, 0.125], AT))
    assert (found.frame_id, found.body_frame_id) == (WORLD, "chassis")
    assert (found.linear_velocity.x, found.linear_velocity.y, found.angular_velocity.z) == (0.5, -0.25, 0.125)


def test_a_base_that_cannot_go_sideways_has_no_such_velocity() -> None:
    base = PlanarBase(x="x", y="y", yaw="yaw", forward="f", turn="t")
    found = Odometry.FromString(odometry(robot(base=base), base, PoseMessage(), [0.5, -0.25, 0.125], AT))
    assert found.linear_velocity.y == 0
    assert found.body_frame_id == ""
