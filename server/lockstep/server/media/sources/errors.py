"""Errors of a source, and their description without its address.

SourceError
├── NoSuchMedium   the source has no pictures, or no sound
├── FellBehind     its media were captured too long ago
└── NoSoundServer  PulseAudio is not there, or refused
"""

from av.error import FFmpegError

__all__ = ["FellBehind", "NoSoundServer", "NoSuchMedium", "SourceError", "reason_of"]


class SourceError(Exception):
    """Base of all source errors. The text is for people and never holds the address.

    Attributes:
        name: stable, lower-case identifier; the `reason` of the failure counter
    """

    name = "source"


class NoSuchMedium(SourceError):
    name = "no_such_medium"


class FellBehind(SourceError):
    name = "late"


class NoSoundServer(SourceError):
    name = "no_sound_server"


_REASONS = {
    "ConnectionRefusedError": "refused",
    "FileNotFoundError": "not_found",
    "HTTPUnauthorizedError": "unauthorized",
    "HTTPNotFoundError": "not_found",
    "PermissionError": "not_permitted",
    "TimeoutError": "silent",
    "ExitError": "silent",
    "EOFError": "ended",
    "InvalidDataError": "not_media",
    "ProtocolNotFoundError": "unknown_protocol",
}
_WORDS = {"silent": "no data arrives", "ended": "the source ended", "not_media": "the data is not known media"}


def reason_of(error: Exception) -> tuple[str, str]:
    """Return a stable name, and words for people. Libraries' texts are not used: they hold the address and password."""
    if isinstance(error, SourceError):
        return error.name, str(error)
    reason = _REASONS.get(type(error).__name__, "failed")
    if reason in _WORDS:
        return reason, _WORDS[reason]
    strerror = error.strerror if isinstance(error, OSError | FFmpegError) else None
    return reason, (strerror or reason.replace("_", " ")).lower()[:100]
