"""The ways of two tutorials, with real processes: they end with a robot that moves. How long they take is a figure."""

from pathlib import Path

import pytest

from lockstep.bench.first_drive.run import drive_discovered, drive_template
from tests.support.ros2 import have_ros, ros_environment, ros_python

NODE = Path(__file__).parents[3] / "docs" / "examples" / "ros2" / "turtlebot.py"
STEPS = ["written", "links", "driven"]


@pytest.mark.timeout(300)
async def test_a_robot_from_the_template_is_driven(tmp_path: Path) -> None:
    said: list[str] = []
    found = await drive_template(tmp_path, said.append)
    assert list(found) == STEPS
    assert list(found.values()) == sorted(found.values())
    assert (tmp_path / "my_arm" / "my_arm" / "robot.py").is_file()


@pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine")
@pytest.mark.timeout(300)
async def test_a_robot_behind_ros_2_is_driven_by_the_file_that_its_topics_gave(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in ros_environment().items():
        monkeypatch.setenv(name, value)
    found = await drive_discovered(tmp_path, ros_python(), NODE, lambda _: None)
    assert list(found) == STEPS
    assert (tmp_path / "mine.yaml").is_file()
