from typing import Any

import mujoco
import numpy as np
import pytest

from lockstep.robot_bridge.errors import ModelError
from tests.robot_bridge.robots.mjcf.tools.arms import SIX_JOINTS, TOOL, arm_model
from tests.robot_bridge.robots.mjcf.tools.world import World, parts_in

TABLE = (
    '<worldbody><body name="table" pos="0.55 0.2 0.25"><geom type="box" size="0.25 0.4 0.02"/></body></worldbody>'
    '<custom><text name="lockstep_obstacles" data="{}"/></custom>'
)


def model(words: str = "floor table", base: str = "") -> str:
    return arm_model(SIX_JOINTS, TOOL + TABLE.format(words), base)


def test_a_tool_that_is_led_into_the_table_stays_above_it() -> None:
    world = World(model())
    begun = [world.value(word) for word in "xyz"]
    for step in range(120):
        world.command({"grip.x": begun[0] + 0.001 * step, "grip.z": begun[2] - 0.006 * step})
    assert "the arm is close to the table" in world.tool.faults
    compiled: Any = mujoco.MjModel.from_xml_string(model())
    data: Any = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    arm = set(range(1, compiled.nbody)) - {compiled.body("table").id, compiled.body("base").id}
    for joints in world.way[::10]:
        data.qpos[:6] = joints
        mujoco.mj_forward(compiled, data)
        touching = [set(compiled.geom_bodyid[pair].tolist()) for pair in data.contact.geom]
        assert not [pair for pair in touching if pair & arm and pair - arm]
    assert np.ptp(np.array(world.way[-100:]), axis=0).max() < 0.02  # and does not swing there


@pytest.mark.parametrize(
    ("words", "base", "said"),
    [
        ("shelf", "", "names 'shelf', which is neither a geom nor a body with geoms"),
        ("world", "", None),
        ("elbow", "", "names 'elbow', which a joint moves"),
        ("floor " * 17, "", "names 17 shapes; at most 16"),
        ("floor", '<joint name="rail" type="slide" axis="1 0 0" range="-1 1"/>', "'grip' stands on 'base'"),
    ],
)
def test_obstacles_that_cannot_be_kept_off_are_refused_in_words(words: str, base: str, said: str | None) -> None:
    if said is None:
        parts_in(model(words, base))
        return
    with pytest.raises(ModelError, match=said):
        parts_in(model(words, base))
