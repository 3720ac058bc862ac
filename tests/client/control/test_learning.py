"""What feeds the repeat timer, and when commands are copied: the table that the page runs too."""

from typing import Any

import pytest

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from tests.client.control.vectors import load_vectors
from tests.makers import feedback

CASES: list[dict[str, Any]] = load_vectors("learning.json")["cases"]
MOVING = [1.0]


def command(sender: CommandSender, event: int, at: float, answer_after: float) -> list[float]:
    """Send one command and answer it; when it was sent, in ms after `at`."""
    sends = []
    now = at
    sender.intend(MOVING, at)
    while now < at + answer_after:
        sends += [(now - at) * 1000 for _ in sender.due(now)]
        now = sender.wake_at(now)
    sender.feedback(feedback(event, at_rest=False), at + answer_after)
    return sends


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_what_is_learnt_and_copied_follows_the_shared_table(case: dict[str, Any]) -> None:
    sender = CommandSender(CommandGate("feedback", 4, 0.0), [0.0])
    event = 1
    sender.feedback(feedback(event), 0.0)
    for step in case["steps"]:
        at = step["at_ms"] / 1000
        if "ping_ms" in step:
            sender.retransmission.ping_answered(step["ping_ms"] / 1000)
        if step.get("loss"):
            sender.retransmission.loss(at)
        if "command" in step:
            event += 1
            sends = command(sender, event, at, step["command"]["answer_ms"] / 1000)
            assert sends == pytest.approx(step["command"]["sends_ms"], abs=1e-6)
        assert sender.retransmission.timer.interval * 1000 == pytest.approx(step["interval_ms"], abs=1e-3)
