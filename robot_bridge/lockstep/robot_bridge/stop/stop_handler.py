"""Stops the robot and releases it: presses and resets from the link, a lock-out at the robot, a failure.

`stop_latch.py` decides and `stop_keeper.py` writes to the disk; here the robot is brought to rest, its own stop and
reset are called, and the clients are answered.
"""

import logging

from lockstep.protocol.messages import Reset, Stop
from lockstep.robot_bridge.control.clock import Clock
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.errors import named
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.refusals import Refusals
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.stop.lockout_file import LockoutFile
from lockstep.robot_bridge.stop.stop_keeper import StopKeeper
from lockstep.robot_bridge.stop.stop_latch import OVERTAKEN, ResetRefused, ResetTaken, ResetWaits, StopGiven

__all__ = ["StopHandler"]

HARDWARE_STOP = "the hardware stop is pressed"

_logger = logging.getLogger(__name__)


class StopHandler:
    """Handles every stop and reset of a robot. Call `begin` once the latch is known, then `look` at every tick, and
    `rests` at every tick whose values are at rest.

    Attributes:
        failure: why the run has ended, "robot failed: OSError: ..."; "" while it goes on
    """

    def __init__(
        self,
        robot: Robot,
        core: EventCore,
        shaper: AxisShaper,
        keeper: StopKeeper,
        lockout: LockoutFile | None,
        refusals: Refusals,
        log: EventLog,
        now: Clock,
    ) -> None:
        self.failure = ""
        self._robot = robot
        self._core = core
        self._shaper = shaper
        self._keeper = keeper
        self._lockout = lockout
        self._refusals = refusals
        self._log = log
        self._now = now
        self._resetting: tuple[LinkTransport, Reset] | None = None  # the link whose reset waits for the disk
        self._stop_due = False  # the robot's own stop follows when the axes are at rest
        self._robot_error: BaseException | None = None  # the robot's reset raised it

    def begin(self) -> None:
        """Write stops to the disk from now on; call the robot's own stop if it begins stopped."""
        self._keeper.start(self._written)
        self._stop_due = self._core.stops.state.stopped

    def stop(self, peer: LinkTransport, stop: Stop) -> None:
        """Take a press; it is answered when it is on the disk."""
        given = self._core.stops.stop(stop.press, stop.by, stop.reason, self._now())
        self._note(given, stop.by, stop.reason, stop.press)
        self._keeper.answer(peer, stop.press, given.number)

    def reset(self, peer: LinkTransport, reset: Reset) -> None:
        outcome = self._core.stops.reset(reset.number, self._now())
        if isinstance(outcome, ResetTaken):
            self._released(outcome, reset.by)
        elif isinstance(outcome, ResetWaits):
            self._resetting = peer, reset
            self._keeper.changed()
        elif isinstance(outcome, ResetRefused):
            self._refuse(peer, outcome)

    def fail(self, error: BaseException) -> None:
        """Latch the stop: after a restart of the bridge no axis moves until a reset."""
        if self.failure:
            return
        self.failure = f"robot failed: {named(error)}"[:500]
        _logger.error("%s", self.failure, exc_info=error)
        self._note(self._core.stops.stop("", "", self.failure, self._now()), "", self.failure)

    def look(self, now: float) -> None:
        """Check the lock-out file and the robot's own input: a person at the robot comes before a remote one.

        Raises:
            BaseException: the adapter's, if its reset raised since the last tick.
        """
        if self._robot_error is not None:
            raise self._robot_error
        file = "" if self._lockout is None else self._lockout.reason
        pressed = HARDWARE_STOP if self._robot.hardware_stop() else ""
        reason = " · ".join(filter(None, (file, pressed, self._robot.locked_out())))[:500]
        if reason == self._core.stops.state.locked_out:
            return
        if not reason:
            self._core.stops.let_in()
            self._log.record("let_in", self._core.current)
            return
        self._log.record("locked_out", self._core.current, reason=reason)
        if (given := self._core.stops.lock_out(reason, now)) is not None:
            self._note(given, "at the robot", reason)

    def rests(self) -> None:
        """Call the robot's own stop if it is due: the axes are at rest."""
        if self._stop_due:
            self._stop_due = False
            self._robot.stop()

    def _note(self, given: StopGiven, by: str, reason: str, press: str = "") -> None:
        """Bring the axes to rest first, before any other effect of a stop."""
        if not given.is_new:
            return
        self._shaper.rest()
        self._stop_due |= given.latched
        self._keeper.changed()
        if given.overtaken and self._resetting is not None:
            self._refuse(self._resetting[0], ResetRefused(given.overtaken, "stale_reset", OVERTAKEN))
            self._resetting = None
        self._log.record("stop", self._core.current, by=by, reason=reason, number=given.number, press=press)

    def _written(self, version: int, error: str) -> None:
        """Tell the core that the latch was written to the disk, or could not be, and answer a waiting reset."""
        outcome = self._core.stops.written(version, error)
        if outcome is None or self._resetting is None:
            return
        (peer, reset), self._resetting = self._resetting, None
        if isinstance(outcome, ResetTaken):
            self._released(outcome, reset.by)
        else:
            self._refuse(peer, outcome)

    def _refuse(self, peer: LinkTransport, refused: ResetRefused) -> None:
        self._refusals.send(peer, self._core.refusal(0, refused.reason, refused.detail, stop=refused.number))

    def _released(self, reset: ResetTaken, by: str) -> None:
        if not self._stop_due:  # else the robot has not been told to stop yet
            try:
                self._robot.reset()
                if self._shaper.has_goals:  # the arm may have fallen
                    self._shaper.begin(self._robot.measured_axes(), self._robot.goals())
            except BaseException as error:  # ends the bridge at the next tick, and not the link of the reset
                self._robot_error = error
        self._stop_due = False
        self._log.record("reset", self._core.current, by=by, number=reset.number)
