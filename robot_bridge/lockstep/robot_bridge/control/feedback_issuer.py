"""Issues feedback: measures the robot, and adds the faults and limits that came up since the last feedback."""

import logging
import math
import time
from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.control.clock import Clock
from lockstep.robot_bridge.control.command_span_times import CommandSpanTimes
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.event_times import EventTimes
from lockstep.robot_bridge.control.feedback_room import within_size
from lockstep.robot_bridge.control.last_known import LastKnown
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.robots.base import Measurement, Robot

__all__ = ["FeedbackIssuer"]

_logger = logging.getLogger(__name__)


class FeedbackIssuer:
    """Issues the feedback of an event. Call `issue` whenever the core says that one is due.

    Attributes:
        timing: the times of the command that executes
        times: the event that held at each time
        rested_why: why the robot came to rest on its own, until a command executes; "": it did not
    """

    def __init__(
        self,
        robot: Robot,
        description: RobotDescription,
        core: EventCore,
        shaper: AxisShaper,
        counters: BridgeCounters,
        log: EventLog,
        now: Clock,
    ) -> None:
        self.timing = CommandSpanTimes()
        self.times = EventTimes()
        self.rested_why = ""
        self._robot = robot
        self._description = description
        self._core = core
        self._shaper = shaper
        self._counters = counters
        self._log = log
        self._now = now
        self._last_known = LastKnown(description)
        self._acting: frozenset[str] = frozenset()  # limits that slowed the robot in the last tick
        self._acted: set[str] = set()  # limits that slowed it since the last feedback
        self._source_faults: list[str] = []  # "media: OSError: no camera"
        self._says_too_much = False  # a feedback without room for all its texts was logged

    def issue(self, *, acts: bool = False) -> Feedback:
        """Measure and issue. `acts`: an action moves the robot."""
        taken, began = time.monotonic(), self._now()
        measured = self._robot.measure()
        return self._issue(measured._replace(at_rest=measured.at_rest and not acts), self._shaper.goals, taken, began)

    def issue_failed(self, failure: str) -> Feedback:
        """Issue that the robot failed, with the last measured values if it cannot be measured any more."""
        goals: list[float | None] = []
        try:
            goals = self._shaper.goals
            measured = self._robot.measure()
        except BaseException:  # the robot is not to be trusted any more
            axes, joints = ([math.nan] * len(each) for each in (self._description.axes, self._description.joints))
            measured = Measurement(axes=axes, joints=joints, wrench=[], ranges=[], at_rest=False, faults=[])
        measured = measured._replace(faults=[*measured.faults, failure])
        return self._issue(measured, goals, time.monotonic(), self._now())

    def limits_act(self, acting: frozenset[str]) -> None:
        """Note the limits that slow the robot in this tick; count each spell once, and record its begin and end."""
        if acting == self._acting:
            return
        self._counters.limits.update(acting - self._acting)
        self._acted |= acting | self._acting
        self._acting = acting
        self._log.record("limit", self._core.current, acting=sorted(acting))

    def source_failed(self, fault: str) -> None:
        """Name this fault in all feedback from now on."""
        self._source_faults.append(fault)
        self._core.want_issue()

    def _issue(self, measured: Measurement, goals: Sequence[float | None], taken: float, began: float) -> Feedback:
        """`taken`: time of the measurement on the clock of capture times; `began`: its begin on the clock of motion."""
        measured, unknown = self._last_known.settle(measured)
        if self._source_faults or self.rested_why:
            rested = [self.rested_why] if self.rested_why else []
            measured = measured._replace(faults=[*measured.faults, *rested, *self._source_faults])
        ranges, texts = within_size(measured, goals, unknown, sorted(self._acted | self._acting))
        if texts.left_out and not self._says_too_much:
            self._says_too_much = True
            _logger.warning("a feedback has no room for %d of its faults, limits and unknown values", texts.left_out)
        at_rest = measured.at_rest and self._shaper.at_rest
        measured = measured._replace(at_rest=at_rest, ranges=ranges, faults=texts.faults)
        now = self._now()
        spans = self.timing.measured(began, now)
        feedback = self._core.issue(measured, now, texts.limits, texts.unknown, goals=goals, time=taken, spans=spans)
        measured_by = time.monotonic()  # a picture that was captured before may show less than this feedback has
        self.times.changed(feedback.event, measured_by)
        self._acted.clear()
        self._counters.issued += 1
        self._log.record("feedback", feedback.event, at=measured_by, issue=feedback.issue, at_rest=feedback.at_rest)
        return feedback
