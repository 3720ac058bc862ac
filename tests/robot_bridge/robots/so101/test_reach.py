import mujoco
import numpy as np
import pytest

from lockstep.robot_bridge.kinematics.clearance import Clearance
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES
from lockstep.robot_bridge.robots.so101.model import ARM, JOINT_NAMES, PREFIX, TOOL
from lockstep.robot_bridge.robots.so101.reach import CAPSULES, PAIRS, arm_chain
from lockstep.robot_bridge.robots.so101.robot import So101
from lockstep.robot_bridge.robots.so101.simulation import HOME


def test_the_descriptions_chain_has_the_tool_where_mujoco_has_it(robot: So101) -> None:
    model, data = robot.simulation.model, mujoco.MjData(robot.simulation.model)
    chain, random = arm_chain(robot.describe()), np.random.default_rng(1)
    places = [model.joint(PREFIX + name).qposadr[0] for name in JOINT_NAMES[ARM]]
    for _ in range(50):
        joints = [random.uniform(axis.minimum, axis.maximum) for axis in JOINT_AXES[ARM]]
        data.qpos[places] = joints
        mujoco.mj_kinematics(model, data)
        state, site = chain.at(joints), data.site(PREFIX + TOOL)
        assert state.position == pytest.approx(site.xpos, abs=1e-5)
        assert state.rotation == pytest.approx(site.xmat.reshape(3, 3), abs=1e-4)


def test_the_axes_ranges_are_within_the_models(robot: So101) -> None:
    for axis, joint in zip(JOINT_AXES, robot.describe().joints, strict=True):
        assert joint.minimum is not None
        assert joint.maximum is not None
        assert joint.minimum <= axis.minimum <= joint.minimum + 0.01
        assert joint.maximum >= axis.maximum >= joint.maximum - 0.01


def test_the_capsules_go_through_the_boxes_that_the_links_collide_with(robot: So101) -> None:
    model = robot.simulation.model
    for name in {each for pair in PAIRS for each in pair} - {""}:
        capsule, body = CAPSULES[name], model.body(name)
        for geom in range(body.geomadr[0], body.geomadr[0] + body.geomnum[0]):
            if model.geom_group[geom] != 3:
                continue
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            for signs in np.ndindex(2, 2, 2):
                corner = model.geom_pos[geom] + turn.reshape(3, 3) @ (model.geom_size[geom] * (2 * np.array(signs) - 1))
                assert outside(corner, *map(np.array, capsule[:2])) - capsule.radius < 0.0165, (name, corner)


def outside(
    place: np.typing.NDArray[np.float64], start: np.typing.NDArray[np.float64], end: np.typing.NDArray[np.float64]
) -> float:
    way = end - start
    share = min(max(float((place - start) @ way / (way @ way)), 0.0), 1.0)
    return float(np.linalg.norm(place - start - share * way))


def test_at_home_nothing_is_near(robot: So101) -> None:
    chain = arm_chain(robot.describe())
    apart = Clearance(chain, CAPSULES, PAIRS)
    assert apart.gaps(chain.at(HOME[ARM]), 0.02) == []
