import mujoco
import numpy as np
import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.contact_sense import ContactSense
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver


def test_the_wrench_is_the_sum_of_mujocos_contact_forces_in_the_mounts_frame(driver: Driver) -> None:
    driver.run(0.7, base_wz=1.0)
    driver.run(1.2, base_wz=-0.6)
    driver.run(2.2, base_vx=0.3)
    driver.run(1.0, tool_vz=-0.2)
    model, data = driver.robot.simulation.model, driver.data
    force, torque = np.zeros(3), np.zeros(3)
    mount = data.body("mount")
    robot = model.body("base").id
    for index in range(data.ncon):
        contact = data.contact[index]
        first, second = (model.body_rootid[model.geom_bodyid[geom]] == robot for geom in contact.geom)
        if first == second:
            continue
        local = np.zeros(6)
        mujoco.mj_contactForce(model, data, index, local)
        world = contact.frame.reshape(3, 3).T @ local[:3] * (1.0 if second else -1.0)
        force += world
        torque += np.cross(contact.pos - mount.xpos, world)
    rotation = mount.xmat.reshape(3, 3)
    wrench = ContactSense(model).read(data).wrench
    assert np.linalg.norm(force) > 5.0
    assert wrench[:3] == pytest.approx(rotation.T @ force, abs=1e-6)
    assert wrench[3:] == pytest.approx(rotation.T @ torque, abs=1e-6)


def test_the_normal_forces_carry_the_weight_of_all_that_lies_about(driver: Driver) -> None:
    driver.run(1.0)
    model = driver.robot.simulation.model
    movable = [body for body in range(model.nbody) if model.body_dofnum[body] == 6]
    weight = 9.81 * float(model.body_mass[movable].sum())
    reading = ContactSense(model).read(driver.data)
    assert reading.normal == pytest.approx(weight, rel=0.05)
    assert reading.rubbing == 0.0


def test_the_wrench_follows_a_step_within_a_tenth_of_a_second(robot: MobileManipulator) -> None:
    sense = ContactSense(robot.simulation.model)
    sense.wrench = np.full(6, 10.0)
    for _ in range(25):
        sense.update(robot.simulation.data, 0.004)
    assert np.abs(sense.wrench).max() < 0.5
    sense.clear()
    assert not sense.wrench.any()


def test_what_lies_still_sleeps_and_wakes_when_the_robot_pushes_it_without_a_jump_of_force(driver: Driver) -> None:
    """Asleep it costs nothing; what is felt and heard of it must not change by that."""
    model = driver.robot.simulation.model
    crate = model.body("crate").id
    driver.run(1.5)
    assert driver.data.tree_asleep[model.body_treeid[crate]] >= 0
    before, sense = driver.place("crate"), ContactSense(model)
    asleep = sense.read(driver.data).normal
    bearing = float(np.arctan2(before[1], before[0]))
    forward = {"base_vx": 0.5 * float(np.cos(bearing)), "base_vy": 0.5 * float(np.sin(bearing))}
    while driver.data.tree_asleep[model.body_treeid[crate]] >= 0:
        driver.run(0.004, **forward)
        assert driver.data.time < 20.0
    assert driver.data.ncon > 0
    driver.run(1.0, **forward)
    assert np.linalg.norm(driver.place("crate")[:2] - before[:2]) > 0.2
    driver.run(3.0)
    assert sense.read(driver.data).normal == pytest.approx(asleep, rel=0.25)
