"""The robot of a connection: its description, its feedback, and the driver of its commands."""

import asyncio
from collections import deque
from collections.abc import Callable

from lockstep.client.connection_options import ConnectionOptions
from lockstep.client.control.command_gate import CALM_INTERVAL, CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.client.control.driver import Driver
from lockstep.client.errors import CommandRefused, ConsoleLost, NotArmed
from lockstep.client.media.newest_queue import Readers
from lockstep.client.media.render_log import LIMIT, FeedbackArrival
from lockstep.client.session import Session
from lockstep.client.statistics import EventRate
from lockstep.protocol.console import RobotState
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest
from lockstep.protocol.neutral import neutral_values

__all__ = ["Driving"]


class Driving:
    """Drives the robot, once the console has described it.

    Attributes:
        known: set when the robot is described
        readers: get every new feedback
        arrivals: of the last feedbacks
    """

    def __init__(self, options: ConnectionOptions, session: Session, send: Callable[[Command | Rest], None]) -> None:
        self.known = asyncio.Event()
        self.readers: Readers[Feedback] = Readers()
        self.arrivals: deque[FeedbackArrival] = deque(maxlen=LIMIT)
        self.event_rate = EventRate()
        self._options = options
        self._session = session
        self._send = send
        self._loop = asyncio.get_running_loop()
        self._robot: RobotState | None = None
        self._driver: Driver | None = None
        self._early_feedback: Feedback | None = None  # arrived before the robot's description

    @property
    def driver(self) -> Driver:
        if self._driver is None:
            raise ConsoleLost("not connected yet")
        return self._driver

    @property
    def robot(self) -> RobotState:
        if self._robot is None:
            raise ConsoleLost("not connected yet")
        return self._robot

    def check_ready(self) -> None:
        """Raise CommandRefused unless the robot may move, as far as this connection knows."""
        sender = self.driver.sender
        if not self._session.holds_seat or sender.readiness.ready:
            return
        if sender.newest is not None and sender.newest.stop.stopped:
            raise CommandRefused("stopped", sender.newest.stop.reason)
        raise NotArmed

    def describe(self, robot: RobotState) -> Feedback | None:
        """Take the robot's state. The first one makes the driver; return the feedback that waited for it."""
        self._robot = robot
        if self._driver is not None:
            if robot.link == "down":
                self._driver.hold_back("link_down")
            return None
        description = robot.description
        asked = self._options.event_rate
        rate = min(description.max_event_rate, asked or description.max_event_rate)
        gate = CommandGate(
            self._options.pacing,
            self._options.tolerance["video"],
            1 / rate,
            calm_interval=None if asked else CALM_INTERVAL,
            sound_tolerance=self._options.tolerance["audio"],
            hold=description.hold,
        )
        sender = CommandSender(gate, neutral_values(description.axes))
        self._driver = Driver(sender, self._send, description.max_event_age)
        self._session.seat_changed = sender.seat_changed
        sender.holds_seat = self._session.holds_seat
        self.known.set()
        return self._early_feedback

    def feedback(self, feedback: Feedback) -> bool:
        """Take a feedback; return True if it is newer than all before it."""
        if self._driver is None:
            self._early_feedback = feedback
            return False
        if not self._driver.feedback(feedback):
            return False
        self._session.stop_shown(feedback.stop)
        now = self._loop.time()
        self.event_rate.event(feedback.event, now)
        self.arrivals.append(FeedbackArrival(now, feedback.event))
        self.readers.put(feedback)
        return True

    def refusal(self, refusal: Refusal) -> None:
        if self._driver is not None and (refusal.event or refusal.reason == "link_down"):
            self._driver.refusal(refusal)

    def rendered(self, stream: str, stamp: int) -> None:
        """Note that a picture is on screen; those of the main camera let commands go."""
        cameras = self._robot.description.cameras if self._robot is not None else ()
        if self._driver is not None and cameras and stream == cameras[0].name:
            self._driver.shown(stamp)

    def heard(self, microphone: str, stamp: int) -> None:
        """Note that sound plays, or is too old to: the events follow its pace. Without a gate none is too old."""
        if self._driver is not None and self._options.gate == "event":
            self._driver.heard(microphone, stamp)

    def stopped(self) -> None:
        """Note that this connection has pressed STOP."""
        if self._driver is not None:
            self._driver.hold_back("stopped")

    def round_trip(self, seconds: float) -> None:
        """Take the round trip of a ping."""
        if self._driver is not None:
            self._driver.sender.retransmission.ping_answered(seconds)

    def end(self, lost: ConsoleLost) -> None:
        """End every wait: the connection ended."""
        if self._driver is not None:
            self._driver.end(lost)
        self.readers.close()
