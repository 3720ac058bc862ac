"""Small builders for tests of the bridge's cores."""

from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Command
from lockstep.protocol.serial import MAX_EVENT
from lockstep.robot_bridge.control.event_core import CommandOutcome, EventCore, Refused
from lockstep.robot_bridge.robots.base import Measurement

__all__ = ["AXES", "MAX_AGE", "MEASURED", "NONCE", "command", "core_at", "fresh_core", "reason"]

AXES = (
    Axis(name="vx", label="Forward", unit="m/s", minimum=-1, maximum=1, slew=4, brake=10),
    Axis(name="grip", label="Grip", unit="m", minimum=0.1, maximum=0.5, slew=1, brake=2, rest=0.2),
)
MAX_AGE = 2.0
MEASURED = Measurement(axes=[0.0, 0.2], joints=[], wrench=[], ranges=[], at_rest=True, faults=[])
NEUTRAL = [0.0, 0.2]
NONCE = 77  # of every issue


def fresh_core(event: int = 1, now: float = 100.0) -> EventCore:
    """A core whose first feedback, issue 1 of `event`, was issued at `now`."""
    core = EventCore(AXES, max_event_age=MAX_AGE, first_event=event, nonces=lambda: NONCE)
    core.issue(MEASURED, now)
    return core


def core_at(event: int = 1, now: float = 100.0) -> EventCore:
    """The same, after a neutral command: it may be moved."""
    core = fresh_core(event - 1 or MAX_EVENT, now)
    core.command(command(event, values=NEUTRAL), now)
    core.issue(MEASURED, now)
    return core


def command(event: int, issue: int = 1, values: list[float] | None = None, nonce: int = NONCE) -> Command:
    return Command(event=event, issue=issue, values=[0.5, 0.2] if values is None else values, nonce=nonce)


def reason(outcome: CommandOutcome) -> str:
    """The refusal's reason, or the outcome's name."""
    return outcome.refusal.reason if isinstance(outcome, Refused) else type(outcome).__name__.lower()
