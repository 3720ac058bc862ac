"""Makers of messages for tests of all parts."""

from collections.abc import Sequence

from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Feedback, Refusal, RefusalReason, StopState

__all__ = ["feedback", "goal_axis", "refusal"]


def feedback(
    event: int,
    issue: int = 1,
    *,
    axes: Sequence[float] = (),
    joints: Sequence[float] = (),
    at_rest: bool = True,
    stopped: bool = False,
    stop: StopState | None = None,
    nonce: int = 0,
    neutral_needed: bool = False,
) -> Feedback:
    return Feedback(
        event=event,
        issue=issue,
        time=0.0,
        axes=list(axes),
        joints=list(joints),
        at_rest=at_rest,
        stop=stop or StopState(stopped=stopped),
        nonce=nonce,
        neutral_needed=neutral_needed,
    )


def refusal(event: int, reason: RefusalReason, current: int = 1) -> Refusal:
    return Refusal(event=event, reason=reason, current=current)


def goal_axis(name: str, *, most: float, reach: float, wrap: float | None = None) -> Axis:
    """An axis from `-most` to `most` rad that is told where to be, at 1 rad/s."""
    return Axis(
        name=name,
        label=name,
        unit="rad",
        minimum=-most,
        maximum=most,
        slew=1,
        brake=4,
        kind="goal",
        reach=reach,
        wrap=wrap,
    )
