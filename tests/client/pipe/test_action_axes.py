from lockstep.client.pipe.action_axes import action_axes, without_doubles
from tests.e2e.posed_arm import PosedArm

ARM = PosedArm().describe()
(POSE,) = ARM.poses
TOOL = (*POSE.position, *POSE.rotation)


def test_an_action_has_the_joints_and_not_the_pose_that_stands_in_for_them() -> None:
    names = action_axes(ARM)
    assert set(POSE.instead_of) <= set(names)
    assert not set(TOOL) & set(names)
    assert set(names) | set(TOOL) == {axis.name for axis in ARM.axes}


def test_of_values_for_both_the_joints_count() -> None:
    both = {axis.name: 0.1 for axis in ARM.axes}
    assert without_doubles(ARM, both) == dict.fromkeys(action_axes(ARM), 0.1)
    one_joint = {POSE.instead_of[0]: 0.2, TOOL[0]: 0.3}
    assert without_doubles(ARM, one_joint) == {POSE.instead_of[0]: 0.2}


def test_a_pose_without_its_joints_is_driven() -> None:
    values = {TOOL[0]: 0.3, TOOL[1]: 0.1}
    assert without_doubles(ARM, values) == values
