"""A snapshot is the first picture after the request, named by its event: where recordings have it."""

import re

import pytest

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.actions import ActionFailed
from lockstep.robot_bridge.robots.micromanipulator.actions.snapshot import PATIENCE, Snapshot, TakenPicture
from lockstep.robot_bridge.robots.micromanipulator.description import MICROSCOPE
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import operator


class Pictures:
    def __init__(self) -> None:
        self.newest: TakenPicture | None = TakenPicture(4, 7, 0.0)
        self.taken = 0

    def snapshot(self) -> Snapshot:
        return Snapshot(lambda: self.newest, tick=0.1, taken=self.count)

    def count(self) -> None:
        self.taken += 1


@pytest.fixture
def pictures() -> Pictures:
    return Pictures()


def test_it_waits_for_the_first_picture_after_the_request_and_names_its_event(pictures: Pictures) -> None:
    run = pictures.snapshot()
    assert not run.step().done
    pictures.newest = TakenPicture(5, 7, 12.34e-6)  # of the same event as the one before
    step = run.step()
    assert (step.done, step.text) == (True, "picture of event 7, focus 12.3 µm; only recordings keep it")
    assert pictures.taken == 1


def test_it_fails_where_no_picture_comes(pictures: Pictures) -> None:
    run = pictures.snapshot()

    def wait() -> None:
        for _ in range(round(PATIENCE / 0.1) + 2):
            run.step()

    with pytest.raises(ActionFailed, match="no picture"):
        wait()
    assert pictures.taken == 0


async def test_the_event_that_it_names_is_that_of_a_picture_that_was_sent() -> None:
    async with (
        Bridge(Micromanipulator(), BridgeSettings(port=0)) as bridge,
        RobotLink(*bridge.address, "media") as watcher,
        operator(bridge) as driver,
    ):
        driver.link.send(Act(id="one", name="snapshot", nonce=driver.feedback.nonce))
        while (update := await driver.next(ActionUpdate)).state == "running":
            pass
        assert update.state == "done", update
        named = re.match(r"picture of event (\d+), ", update.text)
        assert named is not None
        async for message in watcher:
            if isinstance(message, Media) and (message.stream, message.stamp) == (MICROSCOPE.name, int(named[1])):
                return
