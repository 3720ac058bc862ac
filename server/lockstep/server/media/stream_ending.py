"""How the streams of one peer end: because serving it failed, or because all streams of their epoch have."""

import logging
from collections.abc import Callable

__all__ = ["StreamEnding"]

logger = logging.getLogger(__name__)


class StreamEnding:
    """Tells of each of the two once; a listener who comes late is told at once. Listeners raise nothing."""

    def __init__(self) -> None:
        self.failure: tuple[str, Exception] | None = None  # stage and error of the first failure
        self._has_ended = False
        self._tell_failed: Callable[[str, Exception], None] = _log_failure
        self._tell_ended: Callable[[], None] = lambda: None

    def on_failed(self, tell: Callable[[str, Exception], None]) -> None:
        """Call `tell` with the stage and the exception once this peer cannot be served."""
        self._tell_failed = tell
        if self.failure is not None:
            tell(*self.failure)

    def on_ended(self, tell: Callable[[], None]) -> None:
        """Call `tell` once another epoch has begun, which has other streams."""
        self._tell_ended = tell
        if self._has_ended:
            tell()

    def fail(self, stage: str, error: Exception) -> None:
        """Tell that this peer cannot be served. Only the first time counts."""
        if self.failure is None:
            self.failure = stage, error
            self._tell_failed(stage, error)

    def end(self) -> None:
        self._has_ended = True
        self._tell_ended()


def _log_failure(stage: str, error: Exception) -> None:
    logger.error("media failed in stage %s", stage, exc_info=error)
