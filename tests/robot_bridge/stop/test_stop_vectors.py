"""The cases of tests/vectors/stop.json, which a bridge in any language can run."""

import json
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.messages import Command
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.stop.stop_latch import ResetNeedless, ResetRefused
from tests.robot_bridge.control.core_helpers import AXES, MAX_AGE, MEASURED, NEUTRAL, reason

CASES = json.loads((Path(__file__).parents[2] / "vectors" / "stop.json").read_text())["cases"]
MOVING = [0.5, 0.2]


class Player:
    def __init__(self) -> None:
        drawn = iter(range(1, 1000))
        self.core = EventCore(AXES, max_event_age=MAX_AGE, nonces=lambda: next(drawn))
        self.issues = [self.core.issue(MEASURED, 0.0)]
        self.numbers = [0]  # of the stops of the case, in order

    def do(self, step: dict[str, Any]) -> object:
        now = step["t"]
        match step["do"]:
            case "issue":
                assert self.core.issue_due(now)
                self.issues.append(self.core.issue(MEASURED, now))
            case "link":
                self.core.interlock.require()
            case "stop":
                number = self.core.stops.stop(step["press"], "", "", now).number
                if number not in self.numbers:
                    assert number > self.numbers[-1]
                    self.numbers.append(number)
                return self.numbers.index(number)
            case "reset":
                outcome = self.core.stops.reset(self.numbers[step["stop"]], now)
                if isinstance(outcome, ResetRefused):
                    return outcome.reason
                return "nothing" if isinstance(outcome, ResetNeedless) else "taken"
            case _:
                return reason(self.core.command(self._command(step), now))
        return None

    def _command(self, step: dict[str, Any]) -> Command:
        answered = self.issues[-1 if step["issue"] == "newest" else -2]
        nonce = answered.nonce + (step["nonce"] == "wrong")
        values = MOVING if step["moves"] else NEUTRAL
        return Command(event=event_after(answered.event), issue=answered.issue, nonce=nonce, values=values)


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case["name"]))
def test_the_bridge_does_what_the_vectors_say(case: dict[str, Any]) -> None:
    player = Player()
    for number, step in enumerate(case["steps"], 1):
        assert player.do(step) == step.get("is"), f"step {number}: {step}"
