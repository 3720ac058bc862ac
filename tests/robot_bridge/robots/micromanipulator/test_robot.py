from collections.abc import Iterator

import pytest

from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.micromanipulator import Micromanipulator, create
from lockstep.robot_bridge.robots.micromanipulator.description import DESCRIPTION, START, WINDOWS
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES
from lockstep.robot_bridge.robots.micromanipulator.stepper import STEP

REST = [0.0] * 7


@pytest.fixture(scope="module")
def made() -> Iterator[Micromanipulator]:
    robot = create()
    if not isinstance(robot, Micromanipulator):
        raise TypeError(robot)
    yield robot
    robot.close()


def run(robot: Micromanipulator, values: list[float], seconds: float) -> None:
    for _ in range(round(seconds / robot.tick_seconds)):
        robot.apply(values)
        robot.tick()


def test_its_description_is_sound_and_of_micrometres() -> None:
    check_description(DESCRIPTION)
    speeds = [axis.maximum for axis in DESCRIPTION.axes if axis.unit == "m/s"]
    assert all(10 * MICRO < speed < 100 * MICRO for speed in speeds)
    assert DESCRIPTION.wrench is not None
    assert DESCRIPTION.wrench.full_scale_force < 1e-3
    assert DESCRIPTION.ranges is None
    assert DESCRIPTION.cameras[0].metres_per_pixel == 0.5 * MICRO  # 320 µm across: 20x on a sensor of 6.4 mm
    for name, place in zip(("probe.x", "probe.y", "probe.z"), START, strict=True):
        low, high = WINDOWS[name]
        assert low < place < high


def test_all_axes_are_reached_by_touch_and_all_layers_move_the_probe_or_the_microscope() -> None:
    touched = {binding.axis for layer in DESCRIPTION.layers for binding in layer.bindings if binding.touch}
    assert touched == {axis.name for axis in DESCRIPTION.axes}


def test_the_fine_layer_is_a_tenth_as_fast() -> None:
    coarse, fine = DESCRIPTION.layers[:2]
    scales = {binding.axis: binding.scale for binding in coarse.bindings}
    for binding in fine.bindings[:3]:
        assert binding.scale == pytest.approx(scales[binding.axis] / 10)


def test_it_goes_where_it_is_told_in_whole_steps(made: Micromanipulator) -> None:
    before = made.measure().joints
    run(made, [20 * MICRO, -10 * MICRO, *REST[2:]], 0.5)
    measured = made.measure()
    assert measured.joints[0] - before[0] == pytest.approx(10 * MICRO, abs=STEP)
    assert measured.joints[1] - before[1] == pytest.approx(-5 * MICRO, abs=STEP)
    assert measured.axes[0] == pytest.approx(20 * MICRO, rel=0.4)
    assert not measured.at_rest
    for place in measured.joints:
        assert place / STEP == pytest.approx(round(place / STEP), abs=1e-6)
    run(made, REST, 0.5)
    assert made.measure().at_rest
    assert made.measure().axes == REST


def test_pressed_into_a_drop_it_feels_micronewtons_and_says_when_it_is_too_much(made: Micromanipulator) -> None:
    drop = SAMPLES[0]
    x, y, z = made.measure().joints[:3]
    run(made, [(drop.x - x) / 2, (drop.y - y) / 2, *REST[2:]], 2.0)
    run(made, [0.0, 0.0, (drop.height - 4 * MICRO - z) / 2, *REST[3:]], 2.0)
    measured = made.measure()
    assert 0.2e-6 < measured.wrench[2] < 50e-6
    assert measured.faults == []
    state = made.state()
    assert state.contact is not None
    assert state.contact.sample is drop
    run(made, [0.0, 0.0, -15 * MICRO, *REST[3:]], 2.0)
    assert made.measure().faults == ["the needle is bent too far"]
    run(made, [0.0, 0.0, 30 * MICRO, *REST[3:]], 2.0)
    assert made.measure().wrench == [0.0] * 6


def test_the_light_has_an_end(made: Micromanipulator) -> None:
    run(made, [*REST[:6], 50.0], 5.0)
    brightest = made.state().light
    run(made, [*REST[:6], -50.0], 5.0)
    assert 0 < made.state().light < 50 < brightest < 200
    run(made, [*REST[:6], 50.0], 1.6)
