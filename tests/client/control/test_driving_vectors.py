"""The pilot against the cases of tests/vectors/driving.json, which the page's driver is held to as well."""

from typing import Any

import pytest

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.messages import Command, StopState
from tests.client.control.vectors import load_vectors
from tests.makers import feedback, refusal

CASES = load_vectors("driving.json")["cases"]
NEUTRAL = [0.0]
MOVING = [1.0]


class Person:
    """Somebody with a program that drives whenever it may."""

    def __init__(self) -> None:
        self.sender = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
        self.sender.seat_changed(True)
        self.wants: list[float] | None = None
        self._sent = 0

    def take(self, step: dict[str, Any], now: float) -> None:
        sender, do = self.sender, step["do"]
        if do == "feedback":
            stop = StopState(stopped=step.get("stopped", False), number=step.get("stop_number", 0))
            needed = step.get("neutral_needed", False)
            sender.feedback(feedback(step["event"], step.get("issue", 1), stop=stop, neutral_needed=needed), now)
        elif do == "refused":
            sender.refusal(refusal(step["event"], step["reason"]))
        elif do == "arm":
            sender.arm()
        elif do == "seat":
            sender.seat_changed(True)
        elif do == "let_go":
            self.wants = None
            sender.rest(now)
        else:
            self.wants = {"move": MOVING}[do]

    def leaving(self, now: float) -> list[list[object]]:
        """`Console.drive` asks for nothing before the robot may move."""
        if self.wants is not None and self.sender.readiness.ready:
            self.sender.intend(self.wants, now)
        found: list[list[object]] = []
        for message in self.sender.due(now):
            if isinstance(message, Command) and len(self.sender.sent_at) > self._sent:
                self._sent = len(self.sender.sent_at)
                found.append([message.event, "neutral" if message.values == NEUTRAL else "moving"])
        return found


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_what_leaves_is_what_the_cases_say(case: dict[str, Any]) -> None:
    person = Person()
    for number, step in enumerate(case["steps"]):
        now = step["t"] / 1000
        person.take(step, now)
        assert person.leaving(now) == step["leaves"], f"step {number}: {step}"
