import msgspec

from lockstep.bench.experiment.browser import pad_axes
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION


def test_the_sticks_stand_where_the_axes_values_come_from() -> None:
    tilts = pad_axes(DESCRIPTION.layers[0], DESCRIPTION.axes, [0.4, -0.8, 1.5])
    assert tilts == {1: -0.5, 0: 1.0, 2: -1.0}  # forward is up, left is left, and both are negative


def test_at_rest_the_sticks_stand_in_the_middle() -> None:
    tilts = pad_axes(DESCRIPTION.layers[0], DESCRIPTION.axes, [0.0, 0.0, 0.0])
    assert {abs(tilt) for tilt in tilts.values()} == {0.0}


def test_a_stick_moves_a_goal_axis_by_its_share_of_reach_and_not_at_all_without_a_value() -> None:
    axes = tuple(msgspec.structs.replace(axis, kind="goal", reach=0.5) for axis in DESCRIPTION.axes)
    layer = DESCRIPTION.layers[0]
    none = [None] * len(axes)
    assert set(pad_axes(layer, axes, none).values()) == {0.0}
    half = pad_axes(layer, axes, [0.25] * len(axes))
    assert {abs(tilt) for tilt in half.values()} == {0.5}
    assert {abs(tilt) for tilt in pad_axes(layer, axes, [7.0] * len(axes)).values()} == {1.0}
