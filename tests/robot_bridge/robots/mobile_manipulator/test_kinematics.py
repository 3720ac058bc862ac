"""The described kinematics against MuJoCo's own."""

import msgspec
import mujoco
import numpy as np
import numpy.typing as npt
import pytest

from lockstep.protocol.description import Body, RobotDescription
from lockstep.protocol.framing import MAX_CONTROL_FRAME
from lockstep.protocol.messages import Hello, encode_message
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.mobile_manipulator.description import describe
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import Simulation

Matrix = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation()


@pytest.fixture(scope="module")
def description(simulation: Simulation) -> RobotDescription:
    return describe(simulation.model)


def pose(position: tuple[float, float, float], rotation: Matrix) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


def from_quaternion(quaternion: tuple[float, float, float, float]) -> Matrix:
    w, x, y, z = quaternion
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def about(axis: tuple[float, float, float], angle: float) -> Matrix:
    x, y, z = np.sin(angle / 2) * np.array(axis)
    return from_quaternion((float(np.cos(angle / 2)), x, y, z))


def place(body: Body, parents: dict[str, Matrix], joints: dict[str, float]) -> Matrix:
    """Where the description's rules put a body."""
    matrix = parents[body.parent] @ pose(body.position, from_quaternion(body.orientation))
    for joint in body.joints:
        value = joints[joint.joint]
        if joint.kind == "revolute":
            matrix = matrix @ pose((0.0, 0.0, 0.0), about(joint.axis, value))
        else:
            x, y, z = value * np.array(joint.axis)
            matrix = matrix @ pose((x, y, z), np.eye(3))
    return matrix


@pytest.mark.parametrize("seed", range(5))
def test_the_described_bodies_stand_where_mujoco_puts_them(
    simulation: Simulation, description: RobotDescription, seed: int
) -> None:
    random = np.random.default_rng(seed)
    data = mujoco.MjData(simulation.model)
    positions = random.uniform(-2.0, 2.0, len(description.joints))
    data.qpos[:] = simulation.data.qpos
    data.qpos[: len(positions)] = positions
    mujoco.mj_kinematics(simulation.model, data)
    joints = {joint.name: float(value) for joint, value in zip(description.joints, positions, strict=True)}
    places = {"": np.eye(4)}
    for body in description.bodies:
        places[body.name] = place(body, places, joints)
        assert places[body.name][:3, 3] == pytest.approx(data.body(body.name).xpos, abs=1e-4)
        assert places[body.name][:3, :3].ravel() == pytest.approx(data.body(body.name).xmat, abs=1e-4)


def test_no_joint_of_the_model_has_what_the_description_cannot_say(simulation: Simulation) -> None:
    model, count = simulation.model, 9
    assert not model.jnt_pos[:count].any()  # joint axes go through the body's origin
    assert not model.qpos0[:count].any()
    assert model.jnt_qposadr[:count].tolist() == list(range(count))
    assert model.jnt_dofadr[:count].tolist() == list(range(count))
    assert model.actuator_trnid[:, 0].tolist() == list(range(count))


def test_every_drawn_body_has_geoms_and_the_collision_hulls_are_left_out(
    simulation: Simulation, description: RobotDescription
) -> None:
    bodies = {body.name: body for body in description.bodies}
    assert {"room", "table", "base", "range_ring", "mount", "upper_arm", "forearm", "tool"} <= set(bodies)
    assert all(body.geoms for body in description.bodies)
    drum = simulation.model.geom("drum")
    assert all(geom.size != tuple(drum.size) for geom in bodies["base"].geoms)


def test_the_description_is_sound_and_small(description: RobotDescription) -> None:
    check_description(description)
    hello = encode_message(Hello(role="robot", epoch="e", description=description))
    assert len(hello) < min(64_000, MAX_CONTROL_FRAME)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(description), type=RobotDescription) == description
