"""The gate for pictures and sound: one rule, the same in web/, both checked by tests/vectors/gate.json. No I/O.

The mode `event` is the rule. The mode `off` renders everything.
"""

from typing import Generic, Literal, NamedTuple, TypeVar

from lockstep.protocol.serial import event_gap

__all__ = ["GateMode", "Gated", "MediaGate", "Verdict", "verdict"]

GateMode = Literal["event", "off"]
Verdict = Literal["render", "discard", "hold"]
Medium = TypeVar("Medium")


def verdict(
    feedback: int | None, stamp: int | None, tolerance: int, mode: GateMode = "event"
) -> tuple[Verdict, int | None]:
    """Return the verdict on a medium stamped `stamp` while `feedback` is the newest event, and the gap.

    The gap is None when either side is unknown.
    """
    gap = None if feedback is None or stamp is None else event_gap(feedback, stamp)
    if mode == "off":
        return "render", gap
    if stamp is None:
        return "discard", None
    if gap is None or gap < -tolerance:
        return "hold", gap
    return ("render" if gap <= tolerance else "discard"), gap


class Gated(NamedTuple, Generic[Medium]):
    """A medium that may be rendered now."""

    medium: Medium
    stamp: int | None
    gap: int | None


class MediaGate(Generic[Medium]):
    """The gate of one stream. Keeps the newest medium that overtook the feedback, and counts.

    Call `feedback` on every feedback and `offer` with every medium; each returns the medium to render now, or None.
    """

    def __init__(self, tolerance: int, mode: GateMode = "event") -> None:
        self.tolerance = tolerance
        self.mode: GateMode = mode
        self.stamp = 0  # last one seen, 0 before the first
        self.gap = 0  # at the last rendering
        self.max_gap = 0  # largest |gap| rendered
        self.lag = 0  # largest gap seen, rendered or not, since `reported`
        self.received = 0
        self.rendered = 0
        self.discarded = 0
        self.held = 0  # media that had to wait, rendered later or not
        self.violations = 0  # rendered with |gap| > tolerance; in the mode `event` also without a gap
        self._gaps = 0  # sum of |gap| rendered
        self._gaps_known = 0  # renderings with a gap
        self._feedback: int | None = None
        self._waiting: tuple[Medium, int | None] | None = None

    @property
    def newest_feedback(self) -> int | None:
        """The event that media are judged against; None before the first."""
        return self._feedback

    @property
    def mean_gap(self) -> float | None:
        """The mean of |gap| over the rendered media; None before the first gap is known."""
        return self._gaps / self._gaps_known if self._gaps_known else None

    def reported(self) -> None:
        """Begin a new `lag`: the figures were sent off."""
        self.lag = 0

    def feedback(self, event: int) -> Gated[Medium] | None:
        """Take the event of the newest feedback."""
        if self._feedback is not None and event_gap(event, self._feedback) <= 0:
            return None
        self._feedback = event
        if self._waiting is None:
            return None
        medium, stamp = self._waiting
        decision, gap = verdict(event, stamp, self.tolerance, self.mode)
        if decision == "hold":
            return None
        self._waiting = None
        return self._settle(decision, medium, stamp, gap)

    def offer(self, medium: Medium, stamp: int | None) -> Gated[Medium] | None:
        """Take a medium that arrived."""
        self.received += 1
        if stamp is not None:
            self.stamp = stamp
        decision, gap = verdict(self._feedback, stamp, self.tolerance, self.mode)
        if gap is not None:
            self.lag = max(self.lag, gap)
        if decision == "hold":
            self._hold(medium, stamp)
            return None
        return self._settle(decision, medium, stamp, gap)

    def check(self, stamp: int | None) -> tuple[Verdict, int | None]:
        """Return the verdict now on a medium that was let through before."""
        return verdict(self._feedback, stamp, self.tolerance, self.mode)

    def _hold(self, medium: Medium, stamp: int | None) -> None:
        if self._waiting is not None:
            self.discarded += 1  # newest wins
        self._waiting = (medium, stamp)
        self.held += 1

    def _settle(self, decision: Verdict, medium: Medium, stamp: int | None, gap: int | None) -> Gated[Medium] | None:
        if decision == "discard":
            self.discarded += 1
            return None
        if self._waiting is not None and self._overtaken(stamp):
            self._waiting = None
            self.discarded += 1
        self.rendered += 1
        self._note_gap(gap)
        return Gated(medium, stamp, gap)

    def _note_gap(self, gap: int | None) -> None:
        """Count the gap, and check the rule again, apart from the verdict."""
        if gap is None:
            self.violations += self.mode == "event"
            return
        self.gap = gap
        self.max_gap = max(self.max_gap, abs(gap))
        self.violations += abs(gap) > self.tolerance
        self._gaps += abs(gap)
        self._gaps_known += 1

    def _overtaken(self, stamp: int | None) -> bool:
        """True if the waiting medium is not newer than the one being rendered: it would step back in time."""
        waiting = self._waiting[1] if self._waiting is not None else None
        return waiting is None or stamp is None or event_gap(waiting, stamp) <= 0
