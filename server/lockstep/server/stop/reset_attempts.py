"""Resets that were sent and whose outcome is not known yet. No I/O, no clock: `now` is passed in.

A reset that had effect shows in the feedback: not stopped, under the number that it named. Otherwise the bridge
refuses it by that number, or a feedback shows a newer stop.
"""

from typing import Generic, NamedTuple, TypeVar

from lockstep.protocol.messages import Refusal, RefusalReason, StopState

__all__ = ["RESET_REASONS", "ResetAttempts", "ResetOutcome"]

Asker = TypeVar("Asker")

PATIENCE = 1.0  # s for the robot's answer
RESET_REASONS = frozenset({"stale_reset", "too_soon", "locked_out", "not_kept"})


class ResetOutcome(NamedTuple, Generic[Asker]):
    """The outcome of the reset that `asker` asked for. `reason`: None if it had effect, else the reason why not."""

    asker: Asker
    number: int
    reason: RefusalReason | None
    detail: str = ""


class _Attempt(Generic[Asker]):
    def __init__(self, asker: Asker, until: float) -> None:
        self.askers = [asker]
        self.until = until


class ResetAttempts(Generic[Asker]):
    """Keeps one attempt for each number; further askers for the same number share its outcome."""

    def __init__(self) -> None:
        self._attempts: dict[int, _Attempt[Asker]] = {}

    def __len__(self) -> int:
        return len(self._attempts)

    def ask(self, number: int, asker: Asker, now: float) -> bool:
        """Add `asker`; True if the reset is to be sent, False if that was just done for somebody else."""
        attempt = self._attempts.get(number)
        if attempt is not None:
            attempt.askers.append(asker)
            return False
        self._attempts[number] = _Attempt(asker, now + PATIENCE)
        return True

    def feedback(self, stop: StopState) -> list[ResetOutcome[Asker]]:
        found: list[ResetOutcome[Asker]] = []
        for number in list(self._attempts):
            if stop.number > number:
                found += self._end(number, "stale_reset", f"the newest stop is number {stop.number}")
            elif stop.number == number and not stop.stopped:
                found += self._end(number, None)
        return found

    def refused(self, refusal: Refusal) -> list[ResetOutcome[Asker]]:
        """End the attempt that was refused. A refusal of anything else is ignored."""
        if refusal.event or refusal.reason not in RESET_REASONS:
            return []
        return self._end(refusal.stop, refusal.reason, refusal.detail)

    def expire(self, now: float) -> list[ResetOutcome[Asker]]:
        """End the attempts that got no answer in time."""
        late = [number for number, attempt in self._attempts.items() if now >= attempt.until]
        return [each for number in late for each in self._end(number, "link_down", "the robot has not answered")]

    def robot_link_down(self, detail: str) -> list[ResetOutcome[Asker]]:
        return [each for number in list(self._attempts) for each in self._end(number, "link_down", detail)]

    def _end(self, number: int, reason: RefusalReason | None, detail: str = "") -> list[ResetOutcome[Asker]]:
        attempt = self._attempts.pop(number, None)
        askers = [] if attempt is None else attempt.askers
        return [ResetOutcome(asker, number, reason, detail) for asker in askers]
