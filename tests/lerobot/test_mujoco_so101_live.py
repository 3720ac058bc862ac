"""A MuJoCo SO-101 behind LeRobot's Robot class: driven by a console with its cameras, and by LeRobot's own commands."""

import json
from pathlib import Path

import numpy as np
import pytest

from lockstep.client import Console
from tests.lerobot.commands import ROOT, newest, reach, run_driving
from tests.lerobot.conftest import running_arm
from tests.lerobot.test_commands_live import PATIENT, dataset_flags, rows

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]

SETTINGS = "robot: tests.lerobot.simulated.mujoco_so101:MujocoSo101\nconfig: {id: bench}\n"
JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
HOME = [0.0, -31.5, 17.2, 88.8, 0.0]  # degrees


@pytest.fixture(autouse=True)
def model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SO101_MODEL_FOLDER", str(ROOT / ".so101"))


async def test_a_console_drives_it_in_degrees_and_sees_both_of_its_cameras_move(tmp_path: Path) -> None:
    async with running_arm(tmp_path, SETTINGS) as arm, Console(arm.stack.operator, audio=False) as console:
        axes = {axis.name: axis for axis in console.description.axes}
        assert list(axes) == [f"{joint}.pos" for joint in (*JOINTS, "gripper")]
        assert [axis.unit for axis in axes.values()] == ["deg"] * 5 + ["%"]
        assert [camera.name for camera in console.description.cameras] == ["overview", "wrist"]
        assert (await newest(console)).axes[:5] == pytest.approx(HOME, abs=3.0)
        before = {name: await picture(console, name) for name in ("overview", "wrist")}
        await console.take_seat()
        reached = await reach(console, {"shoulder_pan.pos": 40.0, "gripper.pos": 80.0})
        assert reached.axes[0] == pytest.approx(40.0, abs=3.0)
        assert reached.axes[5] == pytest.approx(80.0, abs=6.0)
        for name, old in before.items():
            async for each in console.pictures(name):
                if np.abs(pixels(each) - old).mean() > 2.0:
                    break


async def picture(console: Console, camera: str) -> np.ndarray:
    async for each in console.pictures(camera):
        found = pixels(each)
        if found.std() > 5.0:
            return found
    raise AssertionError("no picture")


def pixels(picture: object) -> np.ndarray:
    return picture.frame.to_ndarray(format="gray").astype(float)  # type: ignore[attr-defined, no-any-return]


async def test_lerobots_own_record_and_replay_drive_it_across(tmp_path: Path) -> None:
    """The leader is LeRobot's own teleoperator of the tests; the arm is behind a console, and behind LeRobot there."""
    async with running_arm(tmp_path, SETTINGS) as arm:
        folder = tmp_path / "swing"
        await run_driving(
            *(arm, tmp_path, "lerobot-record", "--robot.type=lockstep", "--teleop.type=scripted_so101"),
            *("--teleop.discover_packages_path=tests.lerobot.parts", *PATIENT, *dataset_flags(tmp_path, "swing", 1)),
            dataset=folder,
        )
        info = json.loads((folder / "meta/info.json").read_text())
        assert info["features"]["action"]["names"] == [f"{joint}.pos" for joint in (*JOINTS, "gripper")]
        assert {key for key in info["features"] if "images" in key} == {
            "observation.images.overview",
            "observation.images.wrist",
        }
        table = rows(folder)
        states = np.array(table["observation.state"])
        assert np.ptp(states[:, 0]) > 5.0
        stack = await run_driving(
            *(arm, tmp_path, "lerobot-replay", "--robot.type=lockstep", "--dataset.repo_id=tests/swing"),
            *(f"--dataset.root={folder}", "--dataset.episode=0", "--play_sounds=false", *PATIENT),
        )
        assert len(await stack.events("executed")) >= len(states)
