"""The stop of a robot: its latch, and the neutral command that each change of it asks for. No I/O, no clock."""

from lockstep.protocol.messages import StopState
from lockstep.robot_bridge.control.issue_schedule import IssueSchedule
from lockstep.robot_bridge.control.restart_interlock import RestartInterlock
from lockstep.robot_bridge.stop.stop_latch import ResetOutcome, ResetTaken, StopGiven, StopLatch, WriteOutcome

__all__ = ["StopCore"]


class StopCore:
    """Stops and releases. After both no axis moves before a neutral command, and a feedback tells it.

    Attributes:
        latch: set as it was left, before the first issue; stops and resets go through this object
    """

    def __init__(self, interlock: RestartInterlock, schedule: IssueSchedule) -> None:
        self.latch = StopLatch()
        self._interlock = interlock
        self._schedule = schedule

    @property
    def state(self) -> StopState:
        return self.latch.state

    def stop(self, press: str, by: str, reason: str, now: float) -> StopGiven:
        """Latch the stop, or count a further one. The axes come to rest if `is_new`."""
        given = self.latch.stop(press, by, reason, now)
        if given.is_new:
            self._interlock.require()
        return given

    def reset(self, number: int, now: float) -> ResetOutcome:
        """Release the stop, now or when the reset is on the disk; moves nothing."""
        outcome = self.latch.reset(number, now)
        if isinstance(outcome, ResetTaken):
            self._interlock.require()
        return outcome

    def written(self, version: int, error: str = "") -> WriteOutcome:
        """Note that the latch's record of `version` is on the disk, or could not be; return a reset's outcome."""
        outcome = self.latch.written(version, error)
        self._schedule.want()  # feedback also says whether the state is kept
        if isinstance(outcome, ResetTaken):
            self._interlock.require()
        return outcome

    def lock_out(self, reason: str, now: float) -> StopGiven | None:
        """Latch a stop that no reset releases before `let_in`, for a person at the robot who locks it."""
        given = self.latch.lock_out(reason, now)
        self._schedule.want()
        if given is not None:
            self._interlock.require()
        return given

    def let_in(self) -> bool:
        """End the lock-out; the stop stays latched. False if the robot was not locked out."""
        if not self.latch.let_in():
            return False
        self._interlock.require()
        return True
