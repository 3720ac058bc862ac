"""Which actions begin and which must end, as docs/robot-link.md says under "Actions"; nothing of Lockstep's."""

import math
from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tests.robot_bridge.conformance.plain_messages import Message

__all__ = ["PlainActions", "RobotNow"]

KEPT = 256  # requests whose outcome is known
TOLD_ANEW = 16  # of them, to a new operator link


class RobotNow(NamedTuple):
    """What a request is judged by."""

    time: float  # s
    event: int
    stopped: bool
    neutral_needed: bool
    is_driven: bool  # an axis is


@dataclass(eq=False)
class PlainActions:
    """Attributes:

    moving: id of the action that moves the robot; "": none
    renewed: s, when it began or was renewed last
    """

    declared: Sequence[Message]
    age: float  # s, max_event_age
    tell: Callable[[Message], None]
    begins_anew: bool = False  # a fault: a repeat of a request that ended begins it again
    needs_neutral: bool = True  # False is a fault
    moving: str = ""
    renewed: float = -math.inf
    outcomes: OrderedDict[str, Message] = field(default_factory=OrderedDict)  # the newest state by id
    since: dict[str, float] = field(default_factory=dict)  # s, by id: when it came to that state
    values: dict[str, Message] = field(default_factory=dict)  # of the parameters, by id of what runs
    recent: deque[tuple[int, float]] = field(default_factory=deque)  # nonces of feedback, and s when it was issued
    voided: float = -math.inf  # s: what was issued until then begins no motion any more

    def issued(self, nonce: int, now: float) -> None:
        self.recent.append((nonce, now))
        while now - self.recent[0][1] > self.age:
            self.recent.popleft()

    def anew(self, now: float) -> list[Message]:
        """What a new operator link is told."""
        told = list(self.outcomes.values())
        told = [each for each in told[:-TOLD_ANEW] if each["state"] == "running"] + told[-TOLD_ANEW:]
        return [{**each, "age": 0.0 if each["state"] == "running" else now - self.since[each["id"]]} for each in told]

    def request(self, act: Message, robot: RobotNow) -> None:
        known = self.outcomes.get(act["id"])
        if known is not None and not (self.begins_anew and known["state"] == "cancelled"):
            self.tell(known)
            return
        action = next((each for each in self.declared if each["name"] == act["name"]), None)
        moves = action is not None and action.get("moves", True)
        values = None if action is None else values_of(action, act["parameters"])
        reason = self.too_often(robot) if action and values is not None else ""
        reason = reason or self.why_not(act, action, values, moves, robot)
        state = {"type": "action", "id": act["id"], "name": act["name"], "moves": moves, "by": act["by"]}
        if reason:
            self.became({**state, "state": "refused", "reason": reason, "event": robot.event}, robot.time)
            return
        self.values[act["id"]] = values or {}
        if moves:
            self.moving, self.renewed = act["id"], robot.time
        self.became({**state, "state": "running", "event": robot.event, "began": robot.event}, robot.time)

    def too_often(self, robot: RobotNow) -> str:
        oldest = next(iter(self.outcomes), None)
        if len(self.outcomes) < KEPT or oldest is None or robot.time - self.since[oldest] > self.age:
            return ""
        self.recent.clear()
        return "too_often"

    def why_not(
        self, act: Message, action: Message | None, values: Message | None, moves: bool, robot: RobotNow
    ) -> str:
        if action is None:
            return "unknown_action"
        if values is None:
            return "bad_parameter"
        if robot.stopped:
            return "stopped"
        if moves and robot.neutral_needed and self.needs_neutral:
            return "not_neutral"
        if not any(
            nonce == act["nonce"] and robot.time - issued <= self.age and not (moves and issued <= self.voided)
            for nonce, issued in self.recent
        ):
            return "late"
        if any(self.outcomes[id]["name"] == act["name"] for id in self.values) or (moves and self.moving):
            return "busy"
        return "driving" if moves and robot.is_driven else ""

    def renew(self, id: str, now: float) -> None:
        """A neutral command executed that names this action."""
        if id and id == self.moving:
            self.renewed = now

    def interrupt(self, reason: str, event: int, now: float) -> None:
        """End the action that moves the robot, and begin none that was asked for before."""
        self.voided = now
        if self.moving:
            self.ended(self.moving, "cancelled", event, now, reason=reason)

    def cancel(self, id: str, event: int, now: float) -> None:
        if id in ("", self.moving):
            self.interrupt("cancelled", event, now)
        elif id in self.values:
            self.ended(id, "cancelled", event, now, reason="cancelled")

    def ended(self, id: str, state: str, event: int, now: float, *, reason: str = "", text: str = "") -> None:
        del self.values[id]
        if id == self.moving:
            self.moving = ""
        progress = {"progress": 1.0} if state == "done" else {}
        self.became(
            {**self.outcomes[id], **progress, "state": state, "reason": reason, "text": text, "event": event}, now
        )

    def became(self, state: Message, now: float) -> None:
        self.outcomes[state["id"]], self.since[state["id"]] = state, now
        if len(self.outcomes) > KEPT:
            oldest = next(id for id in self.outcomes if id not in self.values)
            del self.outcomes[oldest], self.since[oldest]
        self.tell(state)


def values_of(action: Message, named: Message) -> Message | None:
    """Return a value for each parameter of the action; None if they are not of the declared kinds and ranges."""
    declared: dict[str, Message] = {each["name"]: each for each in action.get("parameters", [])}
    values = {name: named.get(name, each.get("default")) for name, each in declared.items()}
    fits = named.keys() <= declared.keys() and all(is_value(declared[name], value) for name, value in values.items())
    return values if fits else None


def is_value(parameter: Message, value: Any) -> bool:
    match parameter["kind"]:
        case "switch":
            return isinstance(value, bool)
        case "choice":
            return value in parameter["choices"]
    least, most = parameter.get("minimum"), parameter.get("maximum")
    return (
        type(value) in (int, float)
        and math.isfinite(value)
        and (least is None or least <= value)
        and (most is None or value <= most)
    )
