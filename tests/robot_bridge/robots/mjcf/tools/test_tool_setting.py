from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf import create
from tests.robot_bridge.robots.mjcf.models import ARM, model_file
from tests.robot_bridge.robots.mjcf.tools.arms import SIX_JOINTS, arm_model

SETTING = '<custom><text name="lockstep_tool" data="{}"/></custom>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (arm_model(more=SETTING.format("hand")), "names 'hand', which is neither a site nor a body"),
        (arm_model(more=SETTING.format("elbow")), None),
        (arm_model(more=SETTING.format("shoulder")), "names 'shoulder', between which and the world are 2 joints"),
        (arm_model(more=SETTING.format("grip twist")), "names 'twist', whose joints another tool has"),
        (arm_model().replace('<position name="waist"', '<motor name="waist"').replace('joint="waist" inheritrange="1"',
         'joint="waist"'), None),
        (arm_model(more=SETTING.format("grip@window")), "names 'grip@window', and the model has no camera 'window'"),
        (arm_model(more=SETTING.format("grip@overview")).replace('camera name="overview"',
         'camera name="overview" mode="targetbody" target="twist"'), "whose view or place is not known: it turns"),
        (arm_model(more=SETTING.format("grip@overview")).replace('<camera name="overview"',
         '<body name="overview"><geom size="0.1"/></body><camera name="overview"'), "the name of a body too"),
        (arm_model(more=SETTING.format("grip@grip")).replace('camera name="overview"', 'camera name="grip"'),
         "the name of a body too"),
        (arm_model(more=SETTING.format("grip@")), "names 'grip@', and no camera behind the @"),
        (arm_model(more=SETTING.format("grip@own")).replace('<site name="grip"',
         '<camera name="own"/><site name="grip"'), "the camera 'own': a joint moves twist against the world"),
        (arm_model(more=SETTING.format("grip@fifth")).replace("</worldbody>",
         "".join(f'<camera name="{name}"/>' for name in ("b", "c", "d", "fifth")) + "</worldbody>"),
         "'fifth', which is not among the first ones"),
        (ARM.replace("</mujoco>", SETTING.format("tip") + "</mujoco>"), "a pose needs 3"),
    ],
)  # fmt: skip
def test_a_tool_that_cannot_have_a_pose_is_refused_in_words(tmp_path: Path, text: str, words: str | None) -> None:
    path = model_file(tmp_path, text)
    if words is None:
        create(path).close()
        return
    with pytest.raises(ModelError, match=words):
        create(path)


def test_a_joint_that_no_servo_moves_ends_the_chain(tmp_path: Path) -> None:
    motor = '<motor name="waist" joint="waist"/>'
    text = arm_model().replace('<position name="waist" joint="waist" inheritrange="1"/>', motor)
    robot = create(model_file(tmp_path, text))
    (pose,) = robot.describe().poses
    robot.close()
    assert pose.instead_of == tuple(name for name, *_ in SIX_JOINTS[1:])
    assert pose.frame == "waist"  # the motor moves it


def test_a_tool_that_is_a_body_has_its_frame_at_the_bodys(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, arm_model(more=SETTING.format("twist"))))
    (pose,) = robot.describe().poses
    frame = next(body for body in robot.describe().bodies if body.name == pose.body)
    robot.close()
    assert (pose.name, pose.body, frame.parent, frame.position) == ("twist", "twist.tool", "twist", (0.0, 0.0, 0.0))
