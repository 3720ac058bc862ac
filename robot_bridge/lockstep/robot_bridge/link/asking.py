"""When a client asks for an answer that is due. No I/O, no clock.

In lock-step nothing follows a command until its feedback has come. If one of them is lost, TCP notices only by its
timer, after a fifth of a second at least. With a ping behind the command, and a pong behind the feedback, the other
side's acknowledgements tell it a round trip later (RFC 8985). A ping is sent when an answer is late; for some time
after that, since losses come together, one follows each command at once, as it always follows a stop.
"""

from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal, Stop, StopTaken
from lockstep.protocol.pacing.repeat_timer import CAP, RepeatTimer
from lockstep.protocol.serial import is_newer

__all__ = ["EXPECTED_FOR", "MOST_ASKS", "PROBE", "Asking"]

PROBE = 0.005  # s behind a command while losses are expected: in a packet of its own, and behind the robot's next tick
EXPECTED_FOR = 10.0  # s after a late answer
MOST_ASKS = 8  # for one answer


class Asking:
    """Call `sent` and `received` with every message, and ping at `at`, telling `asked` so."""

    def __init__(self) -> None:
        self._timer = RepeatTimer()
        self._command: Command | None = None  # without its feedback
        self._stop: Stop | None = None  # without its number
        self._since = 0.0  # s, when the newest of both was sent
        self._of_command = True
        self._asks = 0
        self._late = 0.0  # s, when this answer is late
        self._probes_until = 0.0  # s
        self.at: float | None = None  # s, when to ask; None: no answer is due

    def sent(self, message: LinkMessage, now: float) -> None:
        """Wait for the answer to a command or a stop; one that is waited for is not waited for anew."""
        if isinstance(message, Command):
            if self._command is not None and self._command.event == message.event:
                return
            self._command = message
        elif isinstance(message, Stop) and message.press:
            if self._stop is not None and self._stop.press == message.press:
                return
            self._stop = message
        else:
            return
        self._since, self._asks, self._of_command = now, 0, isinstance(message, Command)
        self._late = now + self._timer.wait(1)
        probes = now < self._probes_until or isinstance(message, Stop)
        self.at = min(self._late, now + PROBE) if probes else self._late

    def received(self, message: LinkMessage, now: float) -> None:
        """Take an answer. A late one may be of a loss or of a path that is longer now: it counts in part."""
        command, stop = self._command, self._stop
        if command is not None and _answers(message, command):
            if self._of_command:
                self._timer.sample(min(now - self._since, 2 * (self._late - self._since)))
            self._command = None
        elif stop is not None and isinstance(message, StopTaken) and message.press == stop.press:
            self._stop = None
        else:
            return
        if self._command is None and self._stop is None:
            self.at = None

    def asked(self, now: float) -> None:
        """A ping has been sent."""
        if now < self._late:
            self.at = self._late
            return
        if self._timer.interval < CAP:  # else answers take longer than it ever waits, and this one may be in time
            self._probes_until = now + EXPECTED_FOR
        self._asks += 1
        # As for repeats: the first two come at the interval, then twice as late each time.
        self.at = now + self._timer.wait(self._asks + 1) if self._asks < MOST_ASKS else None


def _answers(message: LinkMessage, command: Command) -> bool:
    match message:
        case Feedback():
            return not is_newer(command.event, message.event)
        case Refusal():
            return message.event == command.event
        case _:
            return False
