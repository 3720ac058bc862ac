"""What drives on does so however often a busy machine holds the robot up."""

from typing import cast

import pytest

from lockstep.bench.harness.driving import ARMINGS, drive_on
from lockstep.client import Console, NotArmed
from lockstep.protocol.messages import Feedback
from tests.makers import feedback


class HeldUp:
    """A console whose robot asks for a neutral command so many times, also while it is being armed."""

    def __init__(self, times: int) -> None:
        self.times = times

    async def arm(self) -> Feedback:
        return self._answer()

    async def drive(self, values: object) -> Feedback:
        return self._answer()

    def _answer(self) -> Feedback:
        self.times -= 1
        if self.times >= 0:
            raise NotArmed
        return feedback(2)


@pytest.mark.parametrize("times", [0, 1, 2, 3, 2 * ARMINGS])
async def test_a_robot_that_is_held_up_while_it_is_armed_is_armed_again(times: int) -> None:
    assert (await drive_on(cast(Console, HeldUp(times)), [0.1])).event == 2


async def test_one_that_asks_for_it_every_time_is_told() -> None:
    with pytest.raises(NotArmed):
        await drive_on(cast(Console, HeldUp(3 * ARMINGS)), [0.1])
