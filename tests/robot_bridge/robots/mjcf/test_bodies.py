"""The 3D view's robot is MuJoCo's own: both place every body alike."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.mjcf.bodies import bodies_of
from lockstep.robot_bridge.robots.mjcf.joints import joints_of
from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from lockstep.server.scene.kinematics import scene_paths, world_positions
from tests.robot_bridge.robots.mjcf.models import EXAMPLE, model_file

ODD = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody><geom type="plane" size="0 0 1"/>
<body name="a" pos="0.1 0.2 0.3" euler="0.3 0.2 0.1">
  <joint name="hinge" type="hinge" axis="0 1 1" pos="0.05 0 0.1" ref="0.4"/>
  <joint name="slide" type="slide" axis="1 0 1" ref="0.2"/>
  <geom size="0.1"/>
  <body name="b" pos="0.3 0 0"><joint name="ball" type="ball"/><geom type="capsule" size="0.05 0.1"/>
    <body name="c" pos="0 0 0.2"><joint name="last" axis="0 0 1" pos="0 0.1 0"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/></body></body>
</body>
<body name="loose" pos="1 1 1"><freejoint/><geom size="0.1"/>
  <body name="rider" pos="0.2 0 0"><geom type="box" size="0.1 0.1 0.1"/></body></body>
</worldbody><actuator><motor joint="hinge"/></actuator></mujoco>"""


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("which", ["odd", "example"])
def test_every_body_is_where_mujoco_has_it(tmp_path: Path, which: str, seed: int) -> None:
    model = load_model(EXAMPLE if which == "example" else model_file(tmp_path, ODD))
    data = mujoco.MjData(model)
    random = np.random.default_rng(seed)
    velocity = random.uniform(-1, 1, model.nv)
    mujoco.mj_integratePos(model, data.qpos, velocity, 1.0)
    mujoco.mj_kinematics(model, data)
    joints = joints_of(model)
    bodies = bodies_of(model, joints)
    described = tuple(part for joint in joints for part in joint.parts)
    values = [value for joint in joints for value in joint.values(data.qpos)]
    description = RobotDescription(name="r", label="R", axes=(), joints=described, bodies=bodies)
    places = dict(
        zip(
            scene_paths(description),
            world_positions(description, {joint.name: value for joint, value in zip(described, values, strict=True)}),
            strict=True,
        )
    )
    for number in range(1, model.nbody):
        assert places[model.body(number).name] == pytest.approx(data.xpos[number].tolist(), abs=1e-9)


def test_geoms_of_every_shape_are_described_and_hulls_are_not(tmp_path: Path) -> None:
    text = ODD.replace('<geom size="0.1"/>', '<geom size="0.1"/><geom size="0.2" group="3"/>', 1)
    model = load_model(model_file(tmp_path, text))
    bodies = {body.name: body for body in bodies_of(model, joints_of(model))}
    assert [geom.shape for geom in bodies["a"].geoms] == ["sphere"]
    assert bodies["b"].geoms[0].shape == "capsule"
    assert bodies["c"].geoms[0].size[0] == pytest.approx(0.006 ** (1 / 3))
    assert bodies["world"].geoms[0].shape == "box"  # the plane
    assert bodies["world"].geoms[0].position[2] < 0


def test_more_loose_things_than_can_be_described_are_left_out(tmp_path: Path) -> None:
    loose = "".join(f'<body name="x{n}"><freejoint/><geom size="0.1"/></body>' for n in range(20))
    model = load_model(model_file(tmp_path, ODD.replace("</worldbody>", loose + "</worldbody>")))
    joints = joints_of(model)
    names = {body.name for body in bodies_of(model, joints)}
    assert "x1" in names
    assert "x19" not in names
    assert len(joints) < 18
