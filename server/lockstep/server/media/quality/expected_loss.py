"""The loss that sound is protected against: Opus in-band FEC is sized by an expectation (RFC 6716 2.1.7). No I/O."""

__all__ = ["ExpectedLoss"]

STEPS = (5, 10, 20, 30)  # percent; a change of step reopens the encoder
MARGIN = 1.5  # times the measured loss
PATIENCE = 30.0  # s of less loss before a step down


class ExpectedLoss:
    """The expected loss, which rises at once and falls a step at a time."""

    def __init__(self, percent: int) -> None:
        self.percent = percent
        self._needed_at: float | None = None  # last time that this much was needed

    def update(self, loss: float, now: float) -> int:
        """Take a measured loss of 0 to 1 and return the percentage to expect."""
        needed = next((step for step in STEPS if step >= 100 * MARGIN * loss), STEPS[-1])
        if self._needed_at is None or needed >= self.percent:
            self._needed_at = now
        if needed > self.percent:
            self.percent = needed
        elif needed < self.percent and now - self._needed_at >= PATIENCE:
            self.percent = max(needed, max((step for step in STEPS if step < self.percent), default=needed))
            self._needed_at = now
        return self.percent
