"""Follows what episodes need to know of the session: where it stands, and what has to be noted in an open episode."""

from typing import Protocol

from lockstep.protocol.console import Seat
from lockstep.protocol.messages import StopState
from lockstep.server.event_clock import EventClock
from lockstep.server.recording.episodes.open_episode import Place
from lockstep.server.recording.episodes.session_checks import CheckedRobot
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.session_events import FeedbackReceived, ResetDone, SeatChanged, StopShown

__all__ = ["EpisodeRobot", "SessionPlace"]


class EpisodeRobot(CheckedRobot, Protocol):
    """The part of the connection to the robot that is needed here."""

    @property
    def up(self) -> bool: ...


class SessionPlace:
    """Show it each feedback and each event that `note` takes."""

    def __init__(self, clock: EventClock, recorder: Recorder, robot: EpisodeRobot) -> None:
        self._clock = clock
        self._recorder = recorder
        self._robot = robot
        self._seat = Seat()
        self._stop = StopState()  # as it was shown last
        self._newest_event = 0  # also after the epoch's end

    def now(self) -> Place:
        thread = self._recorder.running
        recording = "" if thread is None or not thread.running else thread.info.recording
        return Place(self._clock.epoch, self._clock.event, recording, self._robot.up, self._seat.name)

    def at_epoch_end(self) -> Place:
        """Return the place with the last event of the epoch that has ended."""
        here = self.now()
        return here._replace(event=self._newest_event or here.event)

    def fed_back(self, event: FeedbackReceived) -> None:
        self._newest_event = event.feedback.event

    def note(self, event: SeatChanged | StopShown | ResetDone) -> str:
        """Return what has to be noted of it, in words; "": nothing."""
        match event:
            case SeatChanged(seat):
                before, self._seat = self._seat, seat
                return f"{seat.name or 'nobody'} drives ({seat.why})" if seat.holder != before.holder else ""
            case StopShown(stop):
                shown, self._stop = self._stop, stop
                if stop.stopped and (not shown.stopped or stop.number > shown.number):
                    return f"stop {stop.number} by {stop.by or 'somebody'}: {stop.reason}".rstrip(": ")
                return ""
            case ResetDone(by, _, number):
                return f"stop {number} was reset by {by.name}"
