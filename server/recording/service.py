"""What the routes of recordings need."""

from dataclasses import dataclass

from server.access import Access
from server.recording.library import Library

__all__ = ["RecordingService"]


@dataclass(frozen=True)
class RecordingService:
    """`app.state.recordings`; None while a robot's session has failed."""

    library: Library
    access: Access
