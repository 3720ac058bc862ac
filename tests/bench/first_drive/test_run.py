"""The ways of two tutorials, with real processes: they end with a robot that moves. How long they take is a figure."""

from pathlib import Path

import pytest

from lockstep.bench.first_drive.run import drive_discovered, driven_template
from lockstep.client import Console
from tests.support.ros2 import have_ros, ros_environment, ros_python

NODE = Path(__file__).parents[3] / "docs" / "examples" / "ros2" / "turtlebot.py"
STEPS = ["written", "links", "driven"]
DRIVES = 20
LOSING = """
from my_arm import MyArm


class Losing(MyArm):
    def __init__(self):
        super().__init__()
        self.ticks, self.withheld = 0, False

    def apply(self, values):
        self.ticks += self.ticks > 0 or any(values)
        self.withheld = self.lost or (self.withheld and any(values))
        super().apply([0.0, 0.0] if self.withheld else values)

    @property
    def lost(self):
        return 0 < self.ticks < 50

    def measure(self):
        faults = ["motors lost"] if self.lost else ["let go of the controls once"] if self.withheld else []
        return super().measure()._replace(faults=["the lamp is broken", *faults])
"""


@pytest.mark.timeout(300)
async def test_a_robot_from_the_template_is_driven_and_shows_its_picture(tmp_path: Path) -> None:
    async with driven_template(tmp_path, lambda _: None) as driven:
        assert list(driven.seconds) == STEPS
        assert list(driven.seconds.values()) == sorted(driven.seconds.values())
        assert (tmp_path / "my_arm" / "my_arm" / "robot.py").is_file()
        async with Console(driven.link) as console:
            assert console.description.label == "My arm"
            await console.take_seat()
            before = (await console.drive({})).joints[0]
            for _ in range(DRIVES):
                feedback = await console.drive({"shoulder": 0.5})
            assert feedback.joints[0] > max(before, 0.0)
            async for picture in console.pictures():
                assert (picture.frame.width, picture.frame.height) == (320, 320)
                break
            await console.rest()


@pytest.mark.timeout(300)
async def test_a_robot_with_a_fault_that_is_lost_as_it_starts_is_driven_once_the_controls_were_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "losing.py").write_text(LOSING)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    async with driven_template(tmp_path, lambda _: None, robot="losing:Losing") as driven:
        assert list(driven.seconds) == STEPS


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
