from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from lockstep.robot_bridge.robots.mjcf.senses import WrenchSense, range_sense, wrench_sense
from tests.robot_bridge.robots.mjcf.models import EXAMPLE, model_file, one_joint

SERVO = '<position joint="j" kp="2000" kv="100"/>'


def settled(text: str, directory: Path, seconds: float = 2.0) -> tuple[Any, Any, WrenchSense]:
    model = load_model(model_file(directory, text))
    data = mujoco.MjData(model)
    sense = wrench_sense(model)
    if sense is None:
        raise AssertionError("no sense")
    for _ in range(round(seconds / 0.002)):
        mujoco.mj_step(model, data)
        sense.read(data, 0.002)
    return model, data, sense


def sensor_arm(sensors: str, inside: str = "") -> str:
    """A hand on the bar, with a site between the two."""
    hand = (
        f'<body name="hand" pos="0.4 0 0"><geom type="sphere" size="0.05" mass="1"/><site name="palm"/>{inside}</body>'
    )
    text = one_joint(SERVO, more=f"<sensor>{sensors}</sensor>")
    return text.replace('<site name="tip" pos="0.4 0 0"/>', hand)


def test_a_model_without_sensors_feels_and_sees_nothing(tmp_path: Path) -> None:
    model = load_model(model_file(tmp_path, one_joint(SERVO)))
    assert wrench_sense(model) is None
    assert range_sense(model, mujoco.MjData(model)) is None


def test_a_force_sensor_does_not_feel_the_weight_of_the_hand(tmp_path: Path) -> None:
    _, _, sense = settled(sensor_arm('<force site="palm"/><torque site="palm"/>'), tmp_path)
    assert sense.description.body == "hand"
    assert np.abs(sense.value).max() < 0.1  # N of 10


def test_a_push_on_the_hand_is_felt_with_its_direction(tmp_path: Path) -> None:
    model, data, sense = settled(sensor_arm('<force site="palm" cutoff="50"/>'), tmp_path)
    data.xfrc_applied[model.body("hand").id, :3] = (0.0, 3.0, 0.0)
    for _ in range(1000):
        mujoco.mj_step(model, data)
        sense.read(data, 0.002)
    assert sense.value[1] == pytest.approx(3.0, abs=0.2)
    assert sense.description.full_scale_force == 50


def test_touch_is_felt_as_hard_as_the_sensor_says_and_from_where_the_contact_is(tmp_path: Path) -> None:
    table = '<geom type="box" size="0.2 0.2 0.5" pos="0.4 0 0.42"/>'  # its top is at 0.92
    pad = '<site name="pad" type="sphere" size="0.06"/>'
    text = sensor_arm('<touch site="pad"/>', pad).replace("<worldbody>", f"<worldbody>{table}")
    _, data, sense = settled(text.replace(SERVO, '<position joint="j" kp="5" kv="5"/>'), tmp_path, 4.0)
    assert sense.value[2] > 1.0
    assert np.linalg.norm(sense.value[:3]) == pytest.approx(float(data.sensordata[0]), rel=0.1)


def test_the_examples_rangefinder_looks_out_of_the_palm() -> None:
    model = load_model(EXAMPLE)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    sense = range_sense(model, data)
    assert sense is not None
    assert sense.description.count == 1
    assert sense.description.range_max == 0.5
    assert 0.1 < sense.read(data)[0] < 0.3
    data.sensordata[:] = -1.0
    assert sense.read(data) == [0.5]  # nothing seen


@pytest.mark.parametrize("count", [4, 8])
def test_rangefinders_around_a_body_are_a_ring(tmp_path: Path, count: int) -> None:
    sites = "".join(
        f'<site name="s{n}" zaxis="{np.cos(a)} {np.sin(a)} 0"/>'
        for n, a in enumerate(np.linspace(0.1, 0.1 + 2 * np.pi, count, endpoint=False))
    )
    sensors = "".join(f'<rangefinder site="s{n}" cutoff="3"/>' for n in range(count))
    model = load_model(model_file(tmp_path, sensor_arm(sensors, sites)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sense = range_sense(model, data)
    assert sense is not None
    assert sense.description.count == count
    assert sense.description.angle_increment == pytest.approx(2 * np.pi / count)
    assert sense.body.parent == "hand"
    assert len(sense.read(data)) == count
