from lockstep.bench.robots.sixty_hertz import SIXTY_HERTZ_ROBOT
from lockstep.robot_bridge.robots.own_robot import create_own_robot
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot


def test_the_bridge_finds_a_robot_whose_main_camera_alone_is_faster() -> None:
    robot, usual = create_own_robot(SIXTY_HERTZ_ROBOT), PlanarRobot()
    rates = {each.name: each.frame_rate for each in robot.describe().cameras}
    assert rates == {each.name: each.frame_rate for each in usual.describe().cameras} | {"overview": 60.0}
    assert len(robot.sources()) == len(usual.sources())
