"""What the cases about commands allow a bridge to do: measure again at any time, and ask for a neutral command."""

import pytest

from lockstep.robot_bridge.conformance import CASES, Outcome, Result, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from tests.robot_bridge.conformance.plain_bridge import NEUTRAL, Link, PlainBridge, serving
from tests.robot_bridge.conformance.plain_messages import Message


class MeasuresOften(PlainBridge):
    """Another client comes just before each command, so that the bridge measures once more."""

    def command(self, link: Link, command: Message) -> None:
        self.measure()
        super().command(link, command)


class HeldUp(PlainBridge):
    """A busy machine holds it up before every other moving command, so that it needs a neutral one."""

    moving = 0

    def may_execute(self, command: Message) -> str:
        if command["values"] != NEUTRAL and not self.neutral_needed:
            self.moving += 1
            if self.moving % 2 == 1:
                self.neutral_needed = True
                self.measure()
        return super().may_execute(command)


class AnswersAnew(PlainBridge):
    """Measures again in answer to a repeat, instead of sending the stored feedback."""

    def command(self, link: Link, command: Message) -> None:
        if command["event"] == self.event:
            self.measure()
        else:
            super().command(link, command)


async def played(bridge: PlainBridge, name: str) -> Result:
    case = next(case for case in CASES if case.name == name)
    async with serving(bridge):
        return await play(Subject(Place(*bridge.address)), case)


@pytest.mark.parametrize("name", ["repeat", "copies", "repeats_hold_nothing"])
@pytest.mark.parametrize("kind", [MeasuresOften, HeldUp])
async def test_a_bridge_may_measure_again_and_ask_for_a_neutral_command_at_any_time(
    kind: type[PlainBridge], name: str
) -> None:
    result = await played(kind(), name)
    assert (result.outcome, result.detail) == (Outcome.OK, "")


async def test_a_new_issue_is_no_answer_to_a_repeat() -> None:
    result = await played(AnswersAnew(), "repeat")
    assert result.outcome is Outcome.FAILED
    assert "was not answered with the stored feedback" in result.detail
