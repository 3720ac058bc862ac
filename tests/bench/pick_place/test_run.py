"""One block, through everything real: MuJoCo, bridge, console, client, recording."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lockstep.bench.pick_place.cli import app, is_kept
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE
from lockstep.server.recording.reading.reader import RecordingReader
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER

KEPT: dict[str, Any] = {"placed": 2, "verified": 2, "of": 2, "jumps": 0, "violations": 0, "largest_step": 0.9}


@pytest.mark.timeout(240)
def test_the_command_puts_a_block_into_the_bowl_and_keeps_its_verified_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    monkeypatch.setenv(FOLDER_VARIABLE, str(MODEL_FOLDER))
    done = CliRunner().invoke(app, ["--times", "1", "--no-pictures", "--keep", str(tmp_path), "--json", "-"])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(done.stdout)["runs"]
    assert (figures["placed"], figures["verified"], figures["jumps"]) == (1, 1, 0)
    assert 0 < figures["largest_step"] <= 1
    [kept] = tmp_path.glob("*.mcap")
    with RecordingReader(kept) as reader:
        assert not reader.interrupted


@pytest.mark.parametrize(
    ("broken", "value"), [("placed", 1), ("verified", 1), ("jumps", 1), ("violations", 1), ("largest_step", 1.1)]
)
def test_each_promise_counts(broken: str, value: float) -> None:
    assert is_kept(KEPT)
    assert not is_kept(KEPT | {broken: value})


def test_an_unknown_network_is_said_at_once() -> None:
    done = CliRunner().invoke(app, ["--network", "no-such-network"])
    assert done.exit_code == 2
    assert "no-such-network" in done.output
