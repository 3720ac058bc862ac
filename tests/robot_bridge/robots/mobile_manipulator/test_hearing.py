import numpy as np

from lockstep.robot_bridge.robots.mobile_manipulator.contact_sense import ContactReading
from lockstep.robot_bridge.robots.mobile_manipulator.hearing import Heard, Hearing
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver


def reading(normal: float, rubbing: float = 0.0) -> ContactReading:
    return ContactReading(np.zeros(6), normal, rubbing)


def test_nothing_is_heard_without_a_tick(driver: Driver) -> None:
    assert Hearing(driver.robot.simulation.model).take() == Heard()


def test_driving_is_heard_as_the_mean_speed_since_the_last_segment(driver: Driver) -> None:
    hearing = Hearing(driver.robot.simulation.model)
    driver.run(0.5, base_vx=0.4)
    for _ in range(3):
        hearing.listen(driver.data, reading(100.0))
    assert abs(hearing.take().wheels - 0.4) < 0.02
    assert hearing.take() == Heard()


def test_a_sudden_rise_of_contact_force_is_a_knock_and_a_steady_force_is_none(driver: Driver) -> None:
    hearing = Hearing(driver.robot.simulation.model)
    for normal in (100.0, 101.0, 100.0, 102.0):
        hearing.listen(driver.data, reading(normal))
    assert hearing.take().knocks == 0.0
    hearing.listen(driver.data, reading(400.0))
    assert hearing.take().knocks > 100.0


def test_a_moving_robot_that_touches_something_rubs(driver: Driver) -> None:
    hearing = Hearing(driver.robot.simulation.model)
    driver.run(0.5, base_vx=0.4)
    hearing.listen(driver.data, reading(100.0, rubbing=10.0))
    touching = hearing.take().rubbing
    hearing.listen(driver.data, reading(100.0))
    assert touching > hearing.take().rubbing + 1.0
