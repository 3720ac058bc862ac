"""Measures the spans of the command that executes, on the bridge's own clock. No I/O; the caller hands in `now`.

Call order: `executed` when a command executes, `applied` after the next tick, `measured` when its feedback is made.
"""

import msgspec

from lockstep.protocol.traces.trace import CommandSpans, span_ms

__all__ = ["CommandSpanTimes"]


class CommandSpanTimes:
    """The times of at most one command: none executes before the last one was answered."""

    def __init__(self) -> None:
        self._executed: float | None = None  # s, when it arrived; None: no command waits for its feedback
        self._applied: tuple[float, float] | None = None  # s, begin and end of the tick that applied it first

    @property
    def waits_for_tick(self) -> bool:
        """True between `executed` and `applied`."""
        return self._executed is not None and self._applied is None

    def executed(self, now: float) -> None:
        """A command arrived at `now` and executes with the next tick."""
        self._executed, self._applied = now, None

    def applied(self, began: float, now: float) -> None:
        """The tick from `began` to `now` was the first that applied the command."""
        if self.waits_for_tick:
            self._applied = began, now

    def measured(self, began: float, now: float) -> CommandSpans | msgspec.UnsetType:
        """Return the spans of the command whose feedback was measured from `began` to `now`, and forget its times."""
        executed, applied = self._executed, self._applied
        self._executed = self._applied = None
        if executed is None:  # an event is measured again
            return msgspec.UNSET
        if applied is None:  # its feedback comes without a tick, as when the bridge fails
            return CommandSpans(measure_ms=span_ms(now - began))
        return CommandSpans(
            tick_wait_ms=span_ms(applied[0] - executed),
            apply_ms=span_ms(applied[1] - applied[0]),
            rate_wait_ms=span_ms(began - applied[1]),
            measure_ms=span_ms(now - began),
        )
