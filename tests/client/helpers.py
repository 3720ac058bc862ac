"""Makers of messages for the client's tests."""

from lockstep.protocol.messages import Feedback, Refusal, RefusalReason, StopState


def feedback(
    event: int,
    issue: int = 1,
    *,
    at_rest: bool = True,
    stopped: bool = False,
    stop: StopState | None = None,
    neutral_needed: bool = False,
) -> Feedback:
    return Feedback(
        event=event,
        issue=issue,
        time=0.0,
        axes=[0.0],
        at_rest=at_rest,
        stop=stop or StopState(stopped=stopped),
        neutral_needed=neutral_needed,
    )


def refusal(event: int, reason: RefusalReason, current: int = 1) -> Refusal:
    return Refusal(event=event, reason=reason, current=current)
