"""The description of a robot of LeRobot: units as it has them, limits by default and by the settings."""

from pathlib import Path

import pytest

from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.lerobot.description import camera_latency, describe
from lockstep.robot_bridge.robots.lerobot.device import AxisFacts, CameraFacts, DeviceFacts, Norm
from lockstep.robot_bridge.robots.lerobot.settings import AxisSettings, CameraSettings, LeRobotSettings
from lockstep.robot_bridge.yaml_file import SettingsPlace, YamlFile

PAN = AxisFacts("shoulder_pan.pos", "degrees", -100.0, 100.0)
FRONT = CameraFacts("front", 641, 481, 30.0, apart=True)


ROOT = Path(__file__).parents[4]


def facts(*axes: AxisFacts, cameras: tuple[CameraFacts, ...] = (), has_torque: bool = True) -> DeviceFacts:
    return DeviceFacts("so101_follower", "desk", axes or (PAN,), cameras, has_torque)


def test_degrees_are_degrees_within_the_calibrated_range() -> None:
    description = describe(LeRobotSettings(), facts())
    (axis,) = description.axes
    assert (axis.name, axis.label, axis.kind, axis.unit) == ("shoulder_pan.pos", "Shoulder pan", "goal", "deg")
    assert (axis.minimum, axis.maximum) == (-100.0, 100.0)
    assert (description.name, description.label) == ("so101-follower-desk", "So101 follower")
    assert [joint.unit for joint in description.joints] == ["rad"]
    check_description(description)


@pytest.mark.parametrize(("norm", "minimum"), [("range_m100_100", -100.0), ("range_0_100", 0.0)])
def test_shares_of_the_range_are_per_cent_and_no_joints(norm: Norm, minimum: float) -> None:
    description = describe(LeRobotSettings(), facts(AxisFacts("gripper.pos", norm)))
    (axis,) = description.axes
    assert (axis.unit, axis.minimum, axis.maximum) == ("%", minimum, 100.0)
    assert description.joints == ()
    check_description(description)


def test_full_speed_ends_within_half_of_hold() -> None:
    (axis,) = describe(LeRobotSettings(hold=0.3), facts()).axes
    assert axis.slew / axis.brake == pytest.approx(0.15)


def test_the_settings_win_over_the_robot_and_the_defaults() -> None:
    given = AxisSettings(label="Turn", minimum=-10.0, slew=5.0, acceleration=7.0, brake=50.0, reach=3.0, wrap=360.0)
    (axis,) = describe(LeRobotSettings(axes={"shoulder_pan.pos": given}), facts()).axes
    assert (axis.label, axis.minimum, axis.maximum, axis.slew) == ("Turn", -10.0, 100.0, 5.0)
    assert (axis.acceleration, axis.brake, axis.reach, axis.wrap) == (7.0, 50.0, 3.0, 360.0)


def test_a_base_of_lekiwi_has_rates() -> None:
    description = describe(LeRobotSettings(), facts(AxisFacts("x.vel"), AxisFacts("theta.vel")))
    assert [(axis.kind, axis.unit, axis.rest) for axis in description.axes] == [
        ("rate", "m/s", 0.0),
        ("rate", "deg/s", 0.0),
    ]
    check_description(description)


@pytest.mark.parametrize(
    ("axis", "given", "where"),
    [
        (AxisFacts("neck.pos"), AxisSettings(), ("axes", "neck.pos", "unit")),
        (AxisFacts("neck.pos", "degrees"), AxisSettings(), ("axes", "neck.pos", "minimum")),
        (AxisFacts("neck.pos"), AxisSettings(unit="mm", minimum=0, maximum=1), ("axes", "neck.pos", "slew")),
        (AxisFacts("neck.pos"), AxisSettings(unit="mm", minimum=0, maximum=1, slew=1), ("axes", "neck.pos", "reach")),
        (PAN._replace(observed=False), AxisSettings(), ("axes", "shoulder_pan.pos")),
    ],
)
def test_what_the_robot_does_not_say_has_to_be_given(
    axis: AxisFacts, given: AxisSettings, where: tuple[str, ...]
) -> None:
    with pytest.raises(SettingsPlace) as error:
        describe(LeRobotSettings(axes={axis.name: given}), facts(axis))
    assert error.value.keys == where


@pytest.mark.parametrize(
    ("settings", "where"),
    [
        (LeRobotSettings(axes={"shoulder_pan": AxisSettings()}), ("axes", "shoulder_pan")),
        (LeRobotSettings(cameras={"rear": CameraSettings()}), ("cameras", "rear")),
        (LeRobotSettings(stop="torque_off"), ("stop",)),
    ],
)
def test_settings_for_what_the_robot_does_not_have_are_errors(
    settings: LeRobotSettings, where: tuple[str, ...]
) -> None:
    with pytest.raises(SettingsPlace) as error:
        describe(settings, facts(has_torque=False))
    assert error.value.keys == where


def test_a_camera_has_even_sides_and_its_own_rate() -> None:
    (camera,) = describe(LeRobotSettings(), facts(cameras=(FRONT,))).cameras
    assert (camera.name, camera.label, camera.width, camera.height, camera.frame_rate) == (
        "front",
        "Front",
        640,
        480,
        30,
    )


def test_a_picture_that_comes_with_the_state_counts_as_older() -> None:
    assert camera_latency(FRONT, CameraSettings()) == 0.05
    assert camera_latency(FRONT._replace(apart=False), CameraSettings()) == 0.5
    assert camera_latency(FRONT, CameraSettings(latency=0.02)) == 0.02


def test_the_example_of_the_documents_is_of_an_arm_with_a_camera() -> None:
    settings = YamlFile(ROOT / "docs/examples/lerobot/arm.yaml").convert(LeRobotSettings)
    assert settings.robot == "so101_follower"
    description = describe(settings, facts(cameras=(FRONT,)))
    assert (description.axes[0].slew, description.axes[0].reach) == (30, 20)
    assert camera_latency(FRONT, settings.cameras["front"]) == 0.08
