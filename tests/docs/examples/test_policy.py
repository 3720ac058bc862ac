"""The example of a policy, in short: one episode to learn from, one that it drives, corrected twice."""

import asyncio
import sys
from pathlib import Path

import pytest

from lockstep.bench.pick_place.judge import judge
from lockstep.server.recording.report.driver_figures import Outcomes
from lockstep.server.recording.report.session import read_session
from tests.client.test_policies import policy_link
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER
from tests.support.stack import running_stack

SCRIPT = Path(__file__).parents[3] / "docs/examples/policy/learn_and_drive.py"
SETTINGS = {
    "SO101_MODEL_FOLDER": str(MODEL_FOLDER),
    "LOCKSTEP_SCENE": "false",
    "LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0",
    "LOCKSTEP_SEAT_TIMEOUT": "30",  # a busy machine may hold the script up
}


@pytest.mark.timeout(240)
async def test_a_policy_learns_drives_and_is_corrected_twice(tmp_path: Path) -> None:
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    async with running_stack(tmp_path, robot="so101", settings=SETTINGS) as stack:
        command = [sys.executable, str(SCRIPT), stack.operator, await policy_link(stack, "net")]
        command += ["--recordings", str(tmp_path), "--episodes", "1"]
        script = await asyncio.create_subprocess_exec(
            *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
        )
        said, _ = await script.communicate()
    assert script.returncode == 0, said.decode()
    recordings = sorted(await asyncio.to_thread(lambda: list(tmp_path.rglob("*.mcap"))))
    assert len(recordings) == 2
    judged = judge(recordings[1])
    assert judged.verdict.ok
    assert 0 < judged.step <= 1, "no joint jumps, not where the robot changes hands either"
    tally = read_session(recordings[1]).drivers
    assert tally.outcomes == {"policy nearest neighbour corrected": Outcomes(success=1)}
    assert tally.interventions == 2
    assert tally.interventions_per_minute is not None
    assert {kind for _, kind in tally.drivers} == {"human", "policy"}
    assert tally.shadows["nearest neighbour"].compared > 0
    assert read_session(recordings[0]).drivers.outcomes == {"Ada": Outcomes(success=1)}
