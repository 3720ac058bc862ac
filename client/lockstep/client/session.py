"""The control seat, participants, notes and STOP of a connection, as the console tells them. No I/O."""

from collections import deque
from collections.abc import Callable

from lockstep.protocol.console import Participants, Role, Seat, ShadowVerdict, SharedNote, Welcome
from lockstep.protocol.messages import Refusal, StopState, StopTaken
from lockstep.protocol.traces.trace_messages import CommandTrace, PictureTrace, Traces

__all__ = ["Session"]

KEPT_NOTES = 100
KEPT_TRACES = 1000  # of pictures, and as many of commands


class Session:
    """The shared state of a connection. Pass every message to `hear`, `stop_shown`, `stop_taken` or `refused`.

    Attributes:
        welcome: this connection's id and role; None before the console sent it
        seat_changed: called with True when this connection becomes the holder of the seat, and with False when it is
            the holder no longer
        refusals: the last refusals of requests, not of commands
    """

    def __init__(self) -> None:
        self.welcome: Welcome | None = None
        self.seat = Seat()
        self.stop_state = StopState()
        self.taken: dict[str, StopTaken] = {}  # answers to presses of this connection
        self.newest_stop = 0  # number of the newest stop that this connection knows
        self.participants = Participants(participants=[])
        self.notes: deque[SharedNote] = deque(maxlen=KEPT_NOTES)
        self.traced_pictures: deque[PictureTrace] = deque(maxlen=KEPT_TRACES)
        self.traced_commands: deque[CommandTrace] = deque(maxlen=KEPT_TRACES)
        self.verdicts: deque[ShadowVerdict] = deque(maxlen=KEPT_TRACES)
        self.seat_changed: Callable[[bool], None] = _ignore
        self.refusals: deque[Refusal] = deque(maxlen=16)

    @property
    def peer(self) -> str:
        return "" if self.welcome is None else self.welcome.peer

    @property
    def role(self) -> Role | None:
        """The role of this connection; None before the console said it."""
        return None if self.welcome is None else self.welcome.role

    @property
    def is_observer(self) -> bool:
        return self.role == "observer"

    @property
    def holds_seat(self) -> bool:
        return bool(self.peer) and self.seat.holder == self.peer

    @property
    def claims_seat(self) -> bool:
        return any(claim.peer == self.peer for claim in self.seat.claims)

    def hear(self, message: Welcome | Seat | Participants | SharedNote | Traces | ShadowVerdict) -> None:
        match message:
            case Traces():
                self.traced_pictures.extend(message.pictures)
                self.traced_commands.extend(message.commands)
            case ShadowVerdict():
                self.verdicts.append(message)
            case Welcome():
                self.welcome = message
            case Participants():
                self.participants = message
            case SharedNote():
                self.notes.append(message)
            case Seat():
                held, self.seat = self.holds_seat, message
                if self.holds_seat is not held:
                    self.seat_changed(self.holds_seat)

    def stop_shown(self, stop: StopState) -> None:
        """Take the robot's present stop state."""
        self.stop_state = stop
        self.newest_stop = max(self.newest_stop, stop.number)

    def stop_taken(self, taken: StopTaken) -> None:
        """Take the robot's answer to a press."""
        if len(self.taken) >= KEPT_NOTES:
            del self.taken[next(iter(self.taken))]
        self.taken[taken.press] = taken
        self.newest_stop = max(self.newest_stop, taken.number)

    def confirmed(self, press: str) -> StopState | None:
        """Return the stop that `press` became; None as long as no message about this press names it."""
        taken, shown = self.taken.get(press), self.stop_state
        if shown.press == press:
            return shown
        return None if taken is None else StopState(stopped=True, number=taken.number, press=press, kept=taken.kept)

    def refused(self, refusal: Refusal) -> None:
        """Take a refusal that names no event."""
        self.refusals.append(refusal)


def _ignore(holds_seat: bool) -> None:
    pass
