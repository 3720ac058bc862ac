"""When a client asks again for an answer that is due. No I/O, no clock.

In lock-step nothing follows a command until its feedback has come. If one of them is lost, TCP notices only by its
timer, after a fifth of a second at least. With a ping behind the command, and a pong behind the feedback, the other
side's acknowledgements tell it a round trip later (RFC 8985).
"""

from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal, Stop, StopTaken
from lockstep.protocol.pacing.repeat_timer import RepeatTimer
from lockstep.protocol.serial import is_newer

__all__ = ["MOST_ASKS", "Asking"]

MOST_ASKS = 8  # for one answer; with the doubled waits that is longer than a silent link lives


class Asking:
    """Call `sent` and `received` with every message, and ping at `at`, telling `asked` so."""

    def __init__(self) -> None:
        self._timer = RepeatTimer()
        self._command: Command | None = None  # without its feedback
        self._stop: Stop | None = None  # without its number
        self._since = 0.0
        self._asks = 0
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
        self._since, self._asks = now, 0
        self._plan(now)

    def received(self, message: LinkMessage, now: float) -> None:
        """Take an answer. Only one that was not asked for tells how long answers take (Karn's rule)."""
        command, stop = self._command, self._stop
        if command is not None and _answers(message, command):
            if self._asks == 0 and stop is None:
                self._timer.sample(now - self._since)
            self._command = None
        elif stop is not None and isinstance(message, StopTaken) and message.press == stop.press:
            self._stop = None
        else:
            return
        if self._command is None and self._stop is None:
            self.at = None

    def asked(self, now: float) -> None:
        """A ping has been sent."""
        self._asks += 1
        self._plan(now)

    def _plan(self, now: float) -> None:
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
