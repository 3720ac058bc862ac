import pytest

from lockstep.protocol.description import Binding, ControlLayer
from lockstep.robot_bridge.robots.mobile_manipulator.controls import AXES, LAYERS

RESERVED = {"Space", "Escape", "Backspace", "Tab", "Enter"}  # deadman, stop, layer, arm


def binding(layer: ControlLayer, axis: str) -> Binding:
    return next(entry for entry in layer.bindings if entry.axis == axis)


def test_every_axis_comes_to_rest_from_full_speed_within_80_ms() -> None:
    for axis in AXES:
        assert max(axis.maximum, -axis.minimum) / axis.brake <= 0.0801


def test_every_axis_is_bound_in_some_layer() -> None:
    bound = {entry.axis for layer in LAYERS for entry in layer.bindings}
    assert bound == {axis.name for axis in AXES}


@pytest.mark.parametrize("layer", LAYERS, ids=lambda layer: layer.name)
def test_no_input_of_a_layer_is_used_twice_nor_a_reserved_key(layer: ControlLayer) -> None:
    keys = [key for entry in layer.bindings for key in (entry.key_positive, entry.key_negative) if key]
    pads = [entry.pad for entry in layer.bindings if entry.pad]
    touches = [entry.touch for entry in layer.bindings if entry.touch]
    assert len(set(keys)) == len(keys)
    assert len(set(pads)) == len(pads)
    assert len(set(touches)) == len(touches)
    assert not RESERVED & set(keys)


@pytest.mark.parametrize(("layer", "axis"), [(0, "base.vx"), (1, "tool.vx"), (0, "tool.vz"), (1, "tool.vz")])
def test_a_stick_pushed_up_is_positive(layer: int, axis: str) -> None:
    entry = binding(LAYERS[layer], axis)
    assert entry.invert_pad  # up is negative on a pad
    assert not entry.invert_touch  # and positive on a touch stick


@pytest.mark.parametrize(("layer", "axis"), [(0, "base.vy"), (0, "base.wz"), (1, "tool.vy"), (1, "tool.wz")])
def test_a_stick_pushed_left_is_positive(layer: int, axis: str) -> None:
    entry = binding(LAYERS[layer], axis)
    assert entry.invert_pad
    assert entry.invert_touch
