"""The YAML file of a ROS 2 robot: the examples are good, and what is wrong is named with its line and key."""

from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import SettingsError
from lockstep.robot_bridge.robots.ros2 import read_settings

EXAMPLES = Path(__file__).parents[4] / "docs" / "examples" / "ros2"

BASE = """\
name: tug
base:
  forward: {maximum: 0.5}
"""
ARM = """\
name: arm
arm:
  joints:
    - {name: elbow, maximum: 1.0}
"""


HOT = "topic: /a, message: Temperature, name: m"


def written(directory: Path, text: str) -> Path:
    path = directory / "robot.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("example", ["base.yaml", "arm.yaml"])
def test_the_examples_describe_a_robot(example: str) -> None:
    settings, description = read_settings(EXAMPLES / example)
    assert description.name == settings.name
    assert description.hold <= 0.5
    bound = {binding.axis for layer in description.layers for binding in layer.bindings}
    assert bound == {axis.name for axis in description.axes}


def test_little_has_to_be_said(tmp_path: Path) -> None:
    settings, description = read_settings(written(tmp_path, BASE))
    assert [axis.name for axis in description.axes] == ["base.vx"]
    assert (description.hold, description.max_event_age) == (0.5, 2.0)
    assert settings.base is not None
    assert (settings.base.command.topic, settings.base.command.message) == ("/cmd_vel", "TwistStamped")


def test_a_base_and_an_arm_are_one_robot(tmp_path: Path) -> None:
    _, description = read_settings(written(tmp_path, BASE + ARM.partition("\n")[2]))
    assert [axis.name for axis in description.axes] == ["base.vx", "arm.elbow"]
    assert [joint.name for joint in description.joints] == ["base.x", "base.y", "base.yaw", "elbow"]
    assert [layer.name for layer in description.layers] == ["drive", "arm1"]


def test_numbers_may_be_written_with_an_exponent(tmp_path: Path) -> None:
    _, description = read_settings(written(tmp_path, BASE.replace("0.5", "5e-1")))
    assert description.axes[0].maximum == 0.5


def test_an_anchor_may_stand_for_what_is_said_twice(tmp_path: Path) -> None:
    text = "name: tug\nbase:\n  forward: &speed {maximum: 0.5}\n  turn:\n    <<: *speed\n    slew: 2.0\n"
    _, description = read_settings(written(tmp_path, text))
    assert [axis.maximum for axis in description.axes] == [0.5, 0.5]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (BASE + "  trun: {maximum: 1}\n", "line 4: base.trun: there is no such setting"),
        (BASE.replace("0.5", "fast"), "line 3: base.forward.maximum: Expected `float`, got `str`"),
        (BASE.replace("0.5", "-1"), "line 3: base.forward.maximum: Expected `float` > 0.0"),
        (BASE + "hold: 9\n", "line 4: hold: Expected `float` <= 5.0"),
        (BASE + "  command: {message: TwistWithCovariance}\n", "line 4: base.command.message: Invalid enum value"),
        (BASE + "  command: {topic: /cmd vel}\n", "line 4: base.command.topic: Expected `str` matching regex"),
        (BASE + "cameras:\n  - name: a\n    topic: /i\n", "line 5: cameras[0]: missing required field `width`"),
        (BASE + "name: twice\n", "line 4: name: given twice"),
        (BASE + "1: x\n", "line 4: 1: a key must be text"),
        (BASE + "    - broken", "robot.yaml: "),
        (BASE + "  radius: *none\n", "robot.yaml: "),
        ("name: x\n", "line 1: there is nothing to drive"),
        ("- a\n", "must hold one map"),
        ("", "must hold one map"),
        (BASE + "ranges: {range_min: 9, range_max: 3}\n", "line 4: ranges.range_min: must be below range_max"),
        (BASE.replace("0.5", "0.5, brake: 0.1"), "line 3: base.forward.brake: braking from 0.5 would take 5.00 s"),
        (BASE.replace("0.5", "0.5, minimum: 0.1"), "line 3: base.forward.minimum: must not be above 0"),
        (ARM.replace("1.0", "1.0, brake: 0.1"), "line 4: arm.joints[0].brake: braking from 1 would take"),
        (ARM + "geofences: []\n" + "wrench: {}\n", "line 6: wrench: missing required field `topic`"),
        (ARM + "    - {name: elbow, maximum: 1.0}\n", "axis name 'arm.elbow' is empty or used twice"),
        (ARM + "servo: {linear: 1, angular: 1, joints: [a]}\n", "line 5: servo: the joints of an arm are driven by"),
        (BASE + "ranges: {body: roof}\n", "sensor ranges names the body 'roof'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line_and_key(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(SettingsError) as caught:
        read_settings(written(tmp_path, text))
    assert complaint in caught.value.detail
    assert "robot.yaml" in caught.value.detail


def test_zones_without_a_base_make_no_sense(tmp_path: Path) -> None:
    zone = "geofences:\n  - {name: z, label: Z, kind: keep_in, polygon: [[0, 0], [1, 0], [1, 1]]}\n"
    with pytest.raises(SettingsError, match="line 5: geofences: zones need a base"):
        read_settings(written(tmp_path, ARM + zone))


def test_in_simulated_time_header_stamps_cannot_tell_when_a_picture_was_taken(tmp_path: Path) -> None:
    camera = "use_sim_time: true\ncameras:\n  - {name: a, topic: /i, width: 64, height: 64}\n"
    with pytest.raises(SettingsError, match=r"line 6: cameras\[0\].captured: simulated time"):
        read_settings(written(tmp_path, BASE + camera))
    read_settings(written(tmp_path, BASE + camera.replace("64}", "64, captured: arrival}")))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="none.yaml: No such file"):
        read_settings(tmp_path / "none.yaml")


def test_a_file_that_is_far_too_long_is_not_read_on(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="longer than"):
        read_settings(written(tmp_path, "# " + "x" * (1 << 20) + "\n" + BASE))


def test_what_contains_itself_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="nested too deeply"):
        read_settings(written(tmp_path, "name: x\nbase: &b\n  forward: *b\n"))


def test_services_become_actions_that_move_nothing(tmp_path: Path) -> None:
    more = "services:\n  - {name: light, service: /light, type: SetBool}\n  - {name: beep, service: /beep}\n"
    _, description = read_settings(written(tmp_path, BASE + more))
    light, beep = description.actions
    assert (light.moves, light.label, [each.name for each in light.parameters]) == (False, "light", ["on"])
    assert (beep.moves, beep.parameters) == (False, ())


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("batteries:\n  - {topic: /a}\n  - {topic: /b}\n", "batteries[1].name: 'battery' is the name of another"),
        ("readings:\n  - {topic: /a, name: m}\n  - {topic: /b, name: m}\n", "readings[1].name: 'm' is the name of"),
        ("readings:\n  - {topic: /a, name: m, kind: switch}\n", "readings[0].kind: a String is no switch"),
        ("readings:\n  - {topic: /a, name: m, warning: 3}\n", "readings[0]: a mode has no unit and no limits"),
        ("readings:\n  - {topic: /a, name: encoder_fallback}\n", "readings[0].name: 'encoder_fallback' is the name of"),
        ("batteries:\n  - {name: hardware_stop}\n", "batteries[0].name: 'hardware_stop' is the name of an item of"),
        (f"readings:\n  - {{topic: /a, name: m, label: {'l' * 201}}}\n", "readings[0].label"),
        (f"readings:\n  - {{{HOT}, error: .nan}}\n", "readings[0].error: a limit is a number"),
        (f"readings:\n  - {{{HOT}, warning: 80, error: 60}}\n", "readings[0].error: it is below the warning"),
        ("services:\n  - {name: x, service: /x, type: Empty}\n", "services[0].type"),
        ("services:\n  - {name: x, service: /x}\n  - {name: x, service: /y}\n", "name is empty or used twice"),
        ("diagnostics: {most: 41}\n", "diagnostics.most"),
    ],
)
def test_services_and_status_that_make_no_sense_are_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(SettingsError) as caught:
        read_settings(written(tmp_path, BASE + text))
    assert complaint in caught.value.detail
