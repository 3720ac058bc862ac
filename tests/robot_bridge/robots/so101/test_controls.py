import pytest

from lockstep.protocol.description import Binding, ControlLayer
from lockstep.robot_bridge.robots.so101.controls import AXES, LAYERS

HOLD = 0.3  # s
RESERVED = {"Space", "Escape", "Backspace", "Tab", "Enter"}  # deadman, stop, layer, arm


def binding(layer: int, axis: str) -> Binding:
    return next(entry for entry in LAYERS[layer].bindings if entry.axis == axis)


def test_every_axis_is_a_goal_that_stands_still_within_hold_from_its_full_speed() -> None:
    for axis in AXES:
        assert axis.kind == "goal"
        assert axis.slew / axis.brake < HOLD
        assert axis.reach > 0


def test_every_axis_is_bound_in_some_layer() -> None:
    assert {entry.axis for layer in LAYERS for entry in layer.bindings} == {axis.name for axis in AXES}


@pytest.mark.parametrize("layer", LAYERS, ids=lambda layer: layer.name)
def test_no_input_of_a_layer_is_used_twice_nor_a_reserved_key(layer: ControlLayer) -> None:
    keys = [key for entry in layer.bindings for key in (entry.key_positive, entry.key_negative) if key]
    pads = [entry.pad for entry in layer.bindings if entry.pad]
    touches = [entry.touch for entry in layer.bindings if entry.touch]
    assert len(set(keys)) == len(keys)
    assert len(set(pads)) == len(pads)
    assert len(set(touches)) == len(touches)
    assert not RESERVED & set(keys)


@pytest.mark.parametrize(("layer", "axis"), [(0, "tool.x"), (0, "tool.z"), (1, "shoulder_lift")])
def test_a_stick_pushed_up_is_positive(layer: int, axis: str) -> None:
    assert (binding(layer, axis).invert_pad, binding(layer, axis).invert_touch) == (True, False)


@pytest.mark.parametrize(("axis", "joint"), [("tool.y", "shoulder_pan")])
def test_a_stick_pushed_left_takes_the_tool_left_by_its_pose_and_by_the_pan_which_counts_to_the_right(
    axis: str, joint: str
) -> None:
    assert (binding(0, axis).invert_pad, binding(0, axis).invert_touch) == (True, True)
    assert (binding(1, joint).invert_pad, binding(1, joint).invert_touch) == (False, False)
    assert (binding(0, axis).key_positive, binding(1, joint).key_negative) == ("KeyA", "KeyA")
