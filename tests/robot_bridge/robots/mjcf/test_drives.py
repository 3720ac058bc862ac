"""What each kind of actuator does with its axis; at rest nothing moves."""

from pathlib import Path
from typing import Any

import mujoco
import pytest

from lockstep.robot_bridge.robots.mjcf.actuators import Kind, actuators_of
from lockstep.robot_bridge.robots.mjcf.drives import Drive, drives_of
from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from tests.robot_bridge.robots.mjcf.models import model_file, one_joint

SECONDS = 0.004


class Bench:
    """One model with its drives."""

    def __init__(self, directory: Path, text: str) -> None:
        self.model = load_model(model_file(directory, text))
        self.data: Any = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.drives: list[Drive] = drives_of(self.model, self.data, actuators_of(self.model))

    def run(self, seconds: float, *values: float) -> None:
        for _ in range(round(seconds / SECONDS)):
            for drive, value in zip(self.drives, values, strict=True):
                drive.drive(self.data, value, SECONDS)
            mujoco.mj_step(self.model, self.data, 2)

    @property
    def place(self) -> float:
        return float(self.data.qpos[0])


@pytest.mark.parametrize(
    ("actuator", "kind"),
    [
        ('<position joint="j" kp="10"/>', Kind.POSITION),
        ('<position joint="j" kp="10" kv="3"/>', Kind.POSITION),
        ('<velocity joint="j" kv="3"/>', Kind.VELOCITY),
        ('<intvelocity joint="j" kp="10" actrange="-1 1"/>', Kind.VELOCITY),
        ('<motor joint="j"/>', Kind.MOTOR),
        ('<motor joint="j" gear="20"/>', Kind.MOTOR),
        ('<general joint="j" gainprm="5" biastype="affine" biasprm="0 -5 -1"/>', Kind.POSITION),
        ('<general joint="j" gainprm="5" biastype="affine" biasprm="1 -2 0"/>', Kind.OTHER),
        ('<damper joint="j" kv="1" ctrlrange="0 1"/>', Kind.OTHER),
        ('<muscle joint="j" lengthrange="0.1 1"/>', Kind.OTHER),
    ],
)
def test_the_kind_of_an_actuator_is_told_by_what_it_does(tmp_path: Path, actuator: str, kind: Kind) -> None:
    assert [each.kind for each in actuators_of(load_model(model_file(tmp_path, one_joint(actuator))))] == [kind]


def test_a_position_servo_is_driven_by_speed_and_keeps_its_posture_at_rest(tmp_path: Path) -> None:
    bench = Bench(tmp_path, one_joint('<position name="servo" joint="j" kp="400" kv="40"/>'))
    axis = bench.drives[0].axis
    assert (axis.unit, axis.rest, axis.maximum) == ("rad/s", 0.0, 0.5)  # 2 rad in 4 s
    bench.run(0.5, 0.0)
    start = bench.place
    bench.run(1.0, -0.4)
    assert bench.place - start == pytest.approx(-0.4, abs=0.06)
    bench.run(0.3, 0.0)
    settled = bench.place
    bench.run(3.0, 0.0)
    assert bench.place == pytest.approx(settled, abs=0.01)


def test_a_position_servo_begins_where_the_model_does(tmp_path: Path) -> None:
    key = '<keyframe><key qpos="0.7"/></keyframe>'
    bench = Bench(tmp_path, one_joint('<position joint="j" kp="400" kv="40"/>', more=key))
    mujoco.mj_resetDataKeyframe(bench.model, bench.data, 0)
    bench.drives[0].release(bench.data)
    bench.run(1.0, 0.0)
    assert bench.place == pytest.approx(0.7, abs=0.02)


def test_a_blocked_servo_does_not_store_up_motion(tmp_path: Path) -> None:
    wall = one_joint('<position joint="j" kp="30" kv="5"/>').replace(
        "<worldbody>", '<worldbody><geom type="box" size="0.02 0.2 0.2" pos="0.25 0 0.75"/>'
    )
    bench = Bench(tmp_path, wall)
    bench.run(20.0, 0.5)
    assert abs(float(bench.data.ctrl[0]) - bench.place) < 0.55
    pushed = float(bench.data.ctrl[0])
    bench.run(0.2, -0.5)
    assert float(bench.data.ctrl[0]) < pushed  # it turns around at once


@pytest.mark.parametrize("gear", [1.0, 4.0, -2.0])
def test_a_velocity_servo_goes_as_fast_as_told_whatever_its_gear(tmp_path: Path, gear: float) -> None:
    text = one_joint(f'<velocity joint="j" kv="50" gear="{gear}"/>', 'type="hinge" axis="0 0 1"')
    bench = Bench(tmp_path, text)
    bench.run(1.0, 0.5)
    assert bench.drives[0].measured(bench.data) == pytest.approx(0.5, abs=0.05)
    bench.run(0.5, 0.0)
    assert bench.drives[0].measured(bench.data) == pytest.approx(0.0, abs=0.02)


def test_a_motor_at_rest_brakes_and_holds_against_gravity(tmp_path: Path) -> None:
    bench = Bench(tmp_path, one_joint('<motor joint="j" ctrlrange="-10 10"/>', 'type="hinge" axis="0 1 0"'))
    assert bench.drives[0].axis.unit == "N m"
    bench.run(0.3, 4.0)
    bench.run(1.0, 0.0)
    held = bench.place
    bench.run(3.0, 0.0)
    assert bench.place == pytest.approx(held, abs=0.01)
    assert abs(bench.drives[0].measured(bench.data)) > 0.1  # the weight is carried


def test_a_motor_too_weak_to_hold_gives_what_it_has(tmp_path: Path) -> None:
    bench = Bench(tmp_path, one_joint('<motor joint="j" ctrlrange="-0.1 0.1"/>', 'type="hinge" axis="0 1 0"'))
    bench.run(1.0, 0.0)
    assert abs(float(bench.data.ctrl[0])) == pytest.approx(0.1)


def test_a_velocity_servo_beside_a_position_servo_gets_no_axis(tmp_path: Path) -> None:
    both = '<position joint="j" kp="100"/><velocity joint="j" kv="10"/>'
    assert len(Bench(tmp_path, one_joint(both)).drives) == 1


@pytest.mark.parametrize(
    ("actuator", "rest"),
    [('<muscle joint="j" lengthrange="0.1 1"/>', 0.0), ('<damper joint="j" kv="1" ctrlrange="2 5"/>', 2.0)],
)
def test_what_is_not_known_rests_where_its_control_is_nearest_to_nothing(
    tmp_path: Path, actuator: str, rest: float
) -> None:
    axis = Bench(tmp_path, one_joint(actuator)).drives[0].axis
    assert axis.rest == rest
    assert axis.unit == ""
