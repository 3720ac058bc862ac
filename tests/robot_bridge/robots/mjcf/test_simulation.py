"""The physics of a model: how it ticks, and what it does when it diverges or takes too long."""

from pathlib import Path

import numpy as np
import pytest

from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from lockstep.robot_bridge.robots.mjcf.simulation import TRIED_TICKS, Simulation
from tests.robot_bridge.robots.mjcf.models import model_file

MODEL = """<mujoco><option timestep="0.001" gravity="0 0 0"/>
<worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/></body></worldbody>
<actuator><motor joint="x"/></actuator><keyframe><key qpos="0.5" qvel="3"/></keyframe></mujoco>"""


@pytest.fixture
def simulation(tmp_path: Path) -> Simulation:
    return Simulation(load_model(model_file(tmp_path, MODEL)))


def test_it_begins_at_the_first_keyframe_at_rest(simulation: Simulation) -> None:
    assert simulation.snapshot().tolist() == [0.5]
    assert simulation.data.qvel.tolist() == [0.0]
    assert simulation.tick_seconds == pytest.approx(0.004)
    assert simulation.tick()
    assert simulation.data.time == pytest.approx(0.004)
    assert simulation.faults == []


def test_a_state_that_diverged_is_put_back_and_is_a_fault(simulation: Simulation) -> None:
    for _ in range(2):
        simulation.tick()
    simulation.data.qvel[:] = np.inf
    assert not simulation.tick()
    assert simulation.snapshot().tolist() == [0.5]
    assert simulation.tick()
    assert simulation.faults == ["the simulation diverged and was restarted (1 times)"]


@pytest.mark.parametrize(("taken", "step", "faults"), [(0.001, 0.004, 0), (0.008, 0.001, 1)])
def test_steps_that_take_too_long_are_left_out_and_the_simulation_is_slow(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, taken: float, step: float, faults: int
) -> None:
    """`taken`: s of work for a tick. `step`: s of the model's time in each tick from then on."""
    times = iter((0.0, taken * TRIED_TICKS))
    monkeypatch.setattr("time.process_time", lambda: next(times))
    simulation.keep_up()
    monkeypatch.undo()
    assert simulation.data.time == 0.0
    simulation.tick()
    assert simulation.data.time == pytest.approx(step)
    assert len(simulation.faults) == faults
