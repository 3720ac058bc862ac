"""Whether the robot may move: the neutral command that comes first, and the stops that ask for it again. No I/O."""

from typing import Literal

from lockstep.protocol.messages import Feedback, RefusalReason

__all__ = ["Readiness"]


class Readiness:
    """Call `lost_by` with each newer feedback, and `answered` with each that answers a command of this connection.

    A neutral command has to be executed before the robot may move: after taking the seat, a stop, a reset, a lost link,
    and whenever the robot says so. It lets motion begin again, so it is wanted only from `begin` on.

    Attributes:
        ready: True if the robot may move: a neutral command was executed since one was last needed
        arming: True if a neutral command is wanted, or on its way
    """

    def __init__(self) -> None:
        self.ready = False
        self.arming = False
        self._asked_again = False  # the answer to the neutral command asked for another one
        self._stop_number: int | None = None  # of the newest stop seen; None before the first feedback

    def begin(self) -> None:
        """Want a neutral command."""
        self.arming, self._asked_again = True, False

    def give_up_arming(self) -> None:
        """Ask for no neutral command any more. `ready` stays as it is."""
        self.arming = False

    def unready(self) -> None:
        """Note that the robot may not move. `arming` stays as it is."""
        self.ready = False

    def lose(self) -> None:
        """Note that the robot may not move before the next `begin`."""
        self.ready = self.arming = False

    def lost_by(self, feedback: Feedback, *, wanted: bool) -> RefusalReason | None:
        """Return why the robot may move no longer; None if nothing has changed.

        `wanted`: a command is wanted or on its way, which a stop ends too.
        """
        known, self._stop_number = self._stop_number, feedback.stop.number
        if feedback.stop.stopped or known not in (None, feedback.stop.number):  # or stopped and reset since then
            return "stopped" if self.ready or self.arming or wanted else None
        return "not_neutral" if self.ready and feedback.neutral_needed else None

    def answered(self, feedback: Feedback, *, neutral: bool) -> Literal["again", "failed"] | None:
        """Decide whether the robot may move now that a command was answered, which was `neutral` or moved an axis.

        A neutral command that answers an issue from before, say, a reset has no effect at the robot, so one more
        follows it ("again"). A cause that outlives that one arose after the arming, which has failed.
        """
        if feedback.stop.stopped or not (self.ready or self.arming):
            return None
        if not feedback.neutral_needed:
            if neutral:
                self.ready, self.arming = True, False
            return None
        if not self.arming:
            return None
        if self._asked_again:
            self.arming = False
            return "failed"
        self._asked_again = neutral
        return "again"
