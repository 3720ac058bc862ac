"""Where the description says that a point is seen is where the picture shows it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from lockstep.robot_bridge.kinematics.rotations import from_quaternion
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from lockstep.server.scene.kinematics import world_poses
from tests.robot_bridge.robots.mjcf.models import model_file

BALL = (0.12, -0.07, 0.05)  # m, of a bright ball in a dark room
MODEL = """<mujoco><compiler angle="radian" autolimits="true"/>
<visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
<worldbody><geom type="sphere" size="0.006" pos="{}" rgba="1 1 1 1"/>
<body name="mast" pos="0.5 0.1 0.4" euler="0 0 0.3"><joint name="pan" axis="0 0 1" range="-1 1"/>
<geom type="box" size="0.001 0.001 0.001" pos="0 0 0.3" rgba="0 0 0 1"/>
<camera name="eye" pos="0.02 0 0.05" xyaxes="0.1 1 0 -0.6 0.06 0.8" fovy="50"/></body></worldbody>
<actuator><position joint="pan"/></actuator>
<keyframe><key qpos="-0.12"/></keyframe></mujoco>"""


def test_a_ball_is_seen_where_the_calibration_says(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, MODEL.format(" ".join(map(str, BALL)))))
    assert isinstance(robot, MjcfRobot)
    description = robot.describe()
    (camera,) = description.cameras
    joints = dict(zip([joint.name for joint in description.joints], robot.positions(), strict=True))
    bodies = world_poses(description, joints)
    found = camera.calibration
    assert found is not None
    assert found.body == "mast"
    place = bodies[found.body]
    turn = from_quaternion(place.orientation) @ from_quaternion(found.orientation)
    middle = np.array(place.position) + from_quaternion(place.orientation) @ found.position
    x, y, z = turn.T @ (np.array(BALL) - middle)
    told = (found.cx + found.fx * x / z, found.cy + found.fy * y / z)
    renderer = mujoco.Renderer(robot.simulation.model, camera.height, camera.width)
    renderer.update_scene(robot.simulation.data, "eye")
    bright = np.argwhere(renderer.render().sum(axis=2) > 600)
    renderer.close()
    robot.close()
    assert len(bright) > 10
    row, column = bright.mean(axis=0)
    assert (column + 0.5, row + 0.5) == pytest.approx(told, abs=1.5)
