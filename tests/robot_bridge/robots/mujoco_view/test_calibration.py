"""A described camera is where MuJoCo has it, and sees what MuJoCo draws."""

import math

import mujoco
import numpy as np
import pytest

from lockstep.protocol.description import Body, Camera
from lockstep.robot_bridge.robots.mujoco_view.calibration import calibrated

MODEL = """
<mujoco><worldbody>
  <camera name="room" pos="1 2 3" euler="10 20 30" fovy="46"/>
  <body name="arm" pos="0.5 0 0.25" euler="0 0 90">
    <joint type="hinge" axis="0 0 1"/><geom size="0.1"/>
    <camera name="hand" pos="0.1 0.2 0.3" euler="40 0 50" fovy="60"/>
    <camera name="follows" mode="targetbody" target="other"/>
    <camera name="flat" projection="orthographic"/>
    <camera name="real" sensorsize="0.01 0.01" resolution="320 240" focal="0.01 0.01"/>
  </body>
  <body name="other"><geom size="0.1"/></body>
</worldbody></mujoco>
"""
ARM = (Body(name="arm", parent=""),)


def camera(name: str) -> Camera:
    return Camera(name=name, label=name, width=320, height=240, frame_rate=15.0)


@pytest.mark.parametrize("name", ["room", "hand"])
def test_its_optical_frame_looks_where_the_model_looks_and_a_point_is_seen_where_it_is_drawn(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = calibrated(camera(name), model, ARM).calibration
    assert found is not None
    number = model.camera(name).id
    turn, carrier = np.empty(9), model.cam_bodyid[number]
    mujoco.mju_quat2Mat(turn, np.array(found.orientation))
    optical = data.xmat[carrier].reshape(3, 3) @ turn.reshape(3, 3)
    theirs = data.cam_xmat[number].reshape(3, 3)
    assert optical == pytest.approx(theirs @ np.diag([1.0, -1.0, -1.0]), abs=1e-5)
    place = data.xpos[carrier] + data.xmat[carrier].reshape(3, 3) @ np.array(found.position)
    assert place == pytest.approx(data.cam_xpos[number], abs=1e-5)
    # A point at the upper edge of the field of view is in the first row.
    edge = math.tan(math.radians(model.cam_fovy[number]) / 2)
    assert found.cy - found.fy * edge == pytest.approx(0.0, abs=1e-3)
    assert found.body == ("arm" if name == "hand" else "")


@pytest.mark.parametrize("name", ["follows", "flat", "real"])
def test_a_camera_that_turns_has_no_perspective_or_its_own_sensor_is_left_as_it_is(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    assert calibrated(camera(name), model, ARM) == camera(name)


def test_a_camera_on_a_body_that_is_not_described_is_left_as_it_is() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    assert calibrated(camera("hand"), model, ()) == camera("hand")
