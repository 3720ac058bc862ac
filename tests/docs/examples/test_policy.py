"""The example of a policy: in short, with one episode to learn from and one that is corrected, and as a whole."""

import asyncio
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lockstep.bench.pick_place.judge import judge
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.report.page import session_page
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.client.live.test_policies import policy_link
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER
from tests.support.stack import running_stack

SCRIPT = Path(__file__).parents[3] / "docs/examples/policy/learn_and_drive.py"
SETTINGS = {
    "SO101_MODEL_FOLDER": str(MODEL_FOLDER),
    "PYTHONPATH": str(SCRIPT.parent),
    "LOCKSTEP_SCENE": "false",
    "LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0",
    "LOCKSTEP_SEAT_TIMEOUT": "30",  # a busy machine may hold the script up
}


async def said_by(folder: Path, *options: str) -> str:
    """Run the script beside a console and an arm; return what it printed."""
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    async with running_stack(folder, robot="varied_blocks:VariedBlocks", settings=SETTINGS) as stack:
        links = {"OPERATOR_LINK": stack.operator, "POLICY_LINK": await policy_link(stack, "net")}
        command = [sys.executable, str(SCRIPT), "--recordings", str(folder), *options]
        script = await asyncio.create_subprocess_exec(
            *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT, env=os.environ | links
        )
        said, _ = await script.communicate()
    assert script.returncode == 0, said.decode()
    return said.decode()


@pytest.mark.timeout(600)
async def test_a_policy_learns_drives_is_corrected_and_learns_of_the_correction(tmp_path: Path) -> None:
    said = await said_by(tmp_path, "--episodes", "1", "--trials", "0", "--corrections", "1")
    assert "corrected once in each of 1 episodes: 1 in the bowl" in said
    assert "it learns again, from 2 episodes" in said
    recordings = sorted(await asyncio.to_thread(lambda: list(tmp_path.rglob("*.mcap"))))
    assert len(recordings) == 2
    roots = await asyncio.to_thread(export_lerobot.export_all, recordings, tmp_path / "dataset", "")
    verdict = await asyncio.to_thread(verify_dataset, roots[0])
    assert verdict.ok, "the demonstration and the corrected episode are one dataset"
    notes = json.loads((roots[0] / "meta" / "lockstep.json").read_text())
    assert [each["outcome"] for each in notes["episodes"]] == ["success", "success"]
    judged = judge(recordings[1])
    assert judged.verdict.ok
    assert 0 < judged.step <= 1, "no joint jumps, not where the robot changes hands either"
    learned, driven = [await asyncio.to_thread(told_of_policies, each) for each in recordings]
    assert learned == ""
    assert re.search(r"1 interventions in [\d.]+ minutes of .* policy drove: [\d.]+ a minute", driven)
    assert re.search(r"demonstrated paths policy \d+ [\d.]+ 0 0 ", driven)
    assert re.search(r"Grace human \d+ [\d.]+ 1 \d+ ", driven)
    assert "policy demonstrated paths corrected 1 0 0 100 %" in driven
    assert re.search(r"demonstrated paths \d+ (in time|\w).* [1-9]\d* \d+ %", driven), "the shadow beside a person"


@pytest.mark.long
@pytest.mark.timeout(3000)
async def test_a_policy_learns_from_ten_episodes_and_again_from_two_corrected_ones(tmp_path: Path) -> None:
    said = await said_by(tmp_path, "--trials", "3")
    assert len(re.findall(r"^episode \d+: ", said, re.MULTILINE)) == 10
    before = re.search(r"alone, before any correction: (\d) of 3", said)
    after = re.search(r"alone, after the corrections: (\d) of 3", said)
    assert before is not None
    assert after is not None
    assert int(before[1]) + int(after[1]) >= 4, said  # a busy machine may lose an episode
    assert re.search(r"corrected once in each of 2 episodes: \d in the bowl", said)
    assert re.search(r"it learns again, from \d+ episodes", said)


def test_without_its_links_it_says_which_to_set_and_none_is_an_argument() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_LINK")}
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--recordings", "nowhere"],
        capture_output=True,
        text=True,
        env=environment,
        timeout=60,
    )
    assert done.returncode == 2
    assert "set OPERATOR_LINK to an operator's link, and POLICY_LINK" in done.stderr
    assert done.stderr.startswith("usage: learn_and_drive.py [-h] --recordings RECORDINGS"), "no link before it"


def told_of_policies(recording: Path) -> str:
    """The text of the section about policies in the report's page; "" where there is none."""
    _, _, rest = session_page(recording).partition("<section id='policies'>")
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", rest.partition("</section>")[0]))
