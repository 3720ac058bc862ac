"""Errors of recordings.

RecordingError
├── RecordingDamaged    not a recording, or not readable to its end
├── RecordingTampered   its checksums do not fit what it holds
├── DatasetRefused      what was asked for does not fit the robot or the dataset
└── DiskTrouble         it cannot be written
"""

__all__ = ["DatasetRefused", "DiskTrouble", "RecordingDamaged", "RecordingError", "RecordingTampered", "shortened"]

LONGEST = 300  # characters of what a file's reader says, which may have any value of the file in it


class RecordingError(Exception):
    """Base class of the errors of recordings.

    Attributes:
        detail: the exact reason, for a person
    """

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return self.detail


class RecordingDamaged(RecordingError):
    pass


class RecordingTampered(RecordingError):
    pass


class DatasetRefused(RecordingError):
    pass


class DiskTrouble(RecordingError):
    pass


def shortened(error: Exception) -> str:
    """Return the words of an error that may name a value of a file, as long as a line of a log at most."""
    text = str(error)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
