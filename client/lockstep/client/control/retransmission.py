"""When the command in flight is sent again, and what is learnt from its answer. No I/O; all times in seconds.

- While the path loses packets every command is followed by `ECHOES` copies, `ECHO` apart, until its answer: a copy
  covers the loss of the command and, being answered from the stored feedback, the loss of the answer too. On a clean
  path nothing is copied.
- Losses come in a row. When a command and all copies were lost on such a path, the first repeat comes early, and each
  repeat is a salvo of `SALVO` copies, which ends with the answer: single repeats would wait out a row of lost packets
  one by one. A repeat that leaves before an answer can have arrived, on a path longer than the interval, is single.
"""

from collections import deque

from lockstep.protocol.pacing.repeat_timer import INITIAL, RepeatTimer

__all__ = ["Retransmission"]

ECHO = 0.020  # s; longer than the console's own path to the robot and back
ECHOES = 3  # at most; with the command itself as many packets as are lost in a row
SALVO = 12
SALVO_SPACING = 0.003  # s
SALVO_LEAST = 0.050  # s; with a shorter interval single repeats are as quick
LOSSY_SPELL = 60.0  # s to go on copying after the last loss that was seen
NEEDLESS = 0.75  # an answer within this part of a ping's round trip after the last repeat answers an earlier sending
NEEDLESS_BLIND = 0.25  # of the whole wait, while no ping is known
PINGS = 8  # pings, the shortest of which counts
FEW_SAMPLES = 8
NEVER = float("inf")


class Retransmission:
    """Call `sent` with each new command, `copies` while it is in flight, and `answered` with its feedback.

    Attributes:
        timer: of the repeats
        samples: from the first sending of a command to its feedback, the last ones
        repeats: sent because no answer came in time
        echoes: sent because the path loses packets
    """

    def __init__(self) -> None:
        self.timer = RepeatTimer()
        self.samples: deque[float] = deque(maxlen=4096)
        self.repeats = 0
        self.echoes = 0
        self._pings: deque[float] = deque(maxlen=PINGS)  # round trips; no command has a shorter one
        self._lossy_until = float("-inf")
        self._sends = 0  # of the command in flight, as all below; its echoes do not count
        self._first_sent_at = self._last_sent_at = 0.0
        self._repeat_at = self._echo_at = NEVER
        self._echoes_left = 0
        self._spacing = ECHO  # between two echoes

    @property
    def due_at(self) -> float:
        """The time of the next copy of the command in flight."""
        return min(self._repeat_at, self._echo_at)

    def sent(self, now: float) -> None:
        """Note that a command leaves for the first time."""
        self._sends = 1
        self._first_sent_at = self._last_sent_at = now
        self._repeat_at = now + self._wait()
        self._echo_at, self._echoes_left, self._spacing = NEVER, 0, ECHO
        if now < self._lossy_until:
            self._echo_at, self._echoes_left = now + ECHO, ECHOES
            if self.timer.early >= SALVO_LEAST:
                self._repeat_at = now + max(self._least(), self.timer.early)

    def copies(self, now: float) -> int:
        """Return how many copies of the command in flight leave now."""
        copies = 0
        if now >= self._repeat_at:
            copies = 1
            self.repeats += 1
            self._sends += 1
            self._last_sent_at = now
            wait = self._wait()
            self._repeat_at = now + wait
            self._echo_at, self._echoes_left = NEVER, 0
            if now < self._lossy_until and wait >= SALVO_LEAST and self._could_be_answered(now):
                self._echo_at, self._echoes_left, self._spacing = now + SALVO_SPACING, SALVO - 1, SALVO_SPACING
        while now >= self._echo_at:
            copies += 1
            self.echoes += 1
            self._echoes_left -= 1
            self._echo_at = self._echo_at + self._spacing if self._echoes_left else NEVER
        return copies

    def answered(self, issue: int, now: float) -> None:
        """Take the issue of the feedback to the command that was in flight."""
        taken = now - self._first_sent_at
        self.samples.append(taken)
        soonest = NEEDLESS * min(self._pings) if self._pings else NEEDLESS_BLIND * taken
        # A later issue of this feedback is a refresh, not an answer.
        if issue == 1 and (self._sends == 1 or now - self._last_sent_at < soonest):
            self.timer.sample(taken)  # echoes make a sample too long at times, which is the safe side
        else:
            self.loss(now)  # and no sample, by Karn's rule

    def ping_answered(self, round_trip: float) -> None:
        """Take a ping's round trip; it stands in for that of a command while few of those are known."""
        self._pings.append(round_trip)
        if len(self.samples) < FEW_SAMPLES:
            self.timer.sample(round_trip)

    def loss(self, now: float) -> None:
        """Note that some message of this connection was lost."""
        self._lossy_until = now + LOSSY_SPELL

    def _could_be_answered(self, now: float) -> bool:
        """True if an answer can have arrived. Before that a repeat says nothing about losses, and a salvo would fill
        the window that SCTP has after a loss."""
        return not self._pings or now - self._first_sent_at >= min(self._pings)

    def _wait(self) -> float:
        return max(self._least(), self.timer.wait(self._sends))

    def _least(self) -> float:
        """Return the least wait. A ping does not reach the robot: until the robot's share is known, pings may lengthen
        the wait but not shorten it."""
        return INITIAL if len(self.samples) < FEW_SAMPLES else 0.0
