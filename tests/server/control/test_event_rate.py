"""A client that keeps no rate of its own drives the robot no faster than the robot's description allows."""

from lockstep.protocol.console import Seat, SeatRequest
from lockstep.protocol.messages import Command, Feedback
from lockstep.robot_bridge.control.issue_schedule import BURST
from tests.server.rig import TestPeer, running_rig

COMMANDS = 20
CLOCKS = 0.005  # s between the clock that paces and the one that feedback is stamped with, over the whole run


async def answer_after(peer: TestPeer, event: int) -> Feedback:
    return await peer.feedback(lambda each: each.event == event + 1)


async def test_commands_that_answer_each_feedback_at_once_execute_at_the_robots_event_rate() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        peer.send("session", SeatRequest())
        await peer.until(lambda each: isinstance(each, Seat) and bool(each.holder))
        feedback = await peer.feedback()
        answers: list[Feedback] = []
        for number in range(COMMANDS):
            before = feedback.event
            values = [0.3 if number else 0.0] + [0.0] * (len(feedback.axes) - 1)
            command = Command(event=before + 1, issue=feedback.issue, nonce=feedback.nonce, values=values)
            for _ in range(3):  # repeats make it no faster
                peer.send("control", command)
            feedback = await answer_after(peer, before)
            answers.append(feedback)
        description = rig.dependencies.console.robot.description
        assert description is not None
        took = answers[-1].time - answers[0].time
        assert took >= (COMMANDS - 1 - BURST) / description.max_event_rate - CLOCKS
        assert rig.count("lockstep_refusals_total", reason="too_often") == 0
