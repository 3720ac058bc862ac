"""LeRobot trains on the episodes of `python -m lockstep.bench.episodes`: two people and a policy, some discarded."""

import asyncio
import json
import os
import sys
from pathlib import Path

import pytest

from tests.lerobot.commands import ROOT, run_lerobot
from tests.lerobot.test_datasets_live import SMALL_ACT

pytestmark = [pytest.mark.long, pytest.mark.timeout(3600)]

FEW = ("--times", "3", "--discard", "1", "--redo", "1", "--no-pictures")


async def test_lerobot_trains_on_episodes_of_two_people_and_a_policy(tmp_path: Path) -> None:
    figures, kept = tmp_path / "figures.json", tmp_path / "kept"
    bench = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "lockstep.bench.episodes", *FEW, "--keep", str(kept), "--json", str(figures)),
        env={**os.environ, "SO101_MODEL_FOLDER": str(ROOT / ".so101")},
    )
    assert await bench.wait() == 0
    [told] = json.loads(await asyncio.to_thread(figures.read_text))["runs"]
    root = kept / "dataset"
    assert told["dataset"]["policy"] > 0
    said = await run_lerobot(
        *(tmp_path, "lerobot-train", "--dataset.repo_id=tests/episodes", f"--dataset.root={root}"),
        *(*SMALL_ACT, f"--output_dir={tmp_path / 'out'}"),
        patience=900,
    )
    assert "step:3" in said
    assert f"dataset.num_episodes={told['kept']}" in said
    assert "End of training" in said
