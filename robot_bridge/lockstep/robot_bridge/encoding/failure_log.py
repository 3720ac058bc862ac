"""Failures of one stream's encoder: all are counted; the first that was not foreseen is logged."""

import logging
from collections.abc import Callable

from lockstep.robot_bridge.errors import EncodingFailed

__all__ = ["FailureLog"]

_logger = logging.getLogger(__name__)


class FailureLog:
    """Tell it of each failure with `add`."""

    def __init__(self, stream: str, count: Callable[[str], None]) -> None:
        """`count` counts what was not encoded, by reason."""
        self._stream = stream
        self._count = count
        self._has_logged = False

    def add(self, error: Exception) -> None:
        """Count a failure. EncodingFailed is foreseen, as for a damaged picture; the stream goes on either way."""
        self._count("encoding_failed")
        if not isinstance(error, EncodingFailed) and not self._has_logged:
            self._has_logged = True
            text = "stream %s: the encoder failed; further failures are only counted"
            _logger.error(text, self._stream, exc_info=error)
