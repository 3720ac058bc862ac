"""One block by the page in Chromium: with an emulated gamepad, and with the controllers of an emulated headset."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.bench.pick_place.cli import app
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER

pytestmark = [pytest.mark.long, pytest.mark.browser, pytest.mark.timeout(720)]


@pytest.mark.parametrize("hand", ["pad", "headset"])
def test_a_page_puts_a_block_into_the_bowl(hand: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    monkeypatch.setenv(FOLDER_VARIABLE, str(MODEL_FOLDER))
    figures_file = tmp_path / "figures.json"
    done = CliRunner().invoke(app, ["--hand", hand, "--times", "1", "--json", str(figures_file)])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(figures_file.read_text())["runs"]
    assert (figures["hand"], figures["placed"], figures["verified"]) == (hand, 1, 1)
    assert (figures["jumps"], figures["violations"]) == (0, 0)
    assert figures["pictures"] > 0
    assert 0 < figures["largest_step"] <= 1
