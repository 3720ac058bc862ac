"""A rest that is repeated until the robot is proven to be at rest. No I/O."""

from lockstep.protocol.messages import Feedback, Rest
from lockstep.protocol.pacing.repeat_timer import RepeatTimer
from lockstep.protocol.serial import event_gap

__all__ = ["RestCall"]

SETTLE = 1.0  # s after which any feedback that is at rest was measured after the rest arrived


class RestCall:
    """A rest and its proof: a feedback at rest that cannot have been measured before the rest took effect. That is the
    feedback to the neutral command that was sent after it, a feedback from a stopped robot, or, when commands are
    refused, a feedback that arrived much later."""

    def __init__(self, rest: Rest, once: bool, now: float) -> None:
        self.rest = rest
        self.once = once  # no axis was moving: send it, and do not wait for proof
        self.due_at = now
        self.neutral: int | None = None  # event of the neutral command that followed
        self._began = now
        self._sends = 0

    def send(self, now: float, timer: RepeatTimer) -> Rest:
        """Return the rest to send now; the next is due after the timer's wait."""
        self._sends += 1
        self.due_at = now + timer.wait(self._sends)
        return self.rest

    def proven_by(self, feedback: Feedback, now: float) -> bool:
        if not feedback.at_rest:
            return False
        answered = self.neutral is not None and event_gap(feedback.event, self.neutral) >= 0
        return answered or feedback.stop.stopped or now - self._began >= SETTLE
