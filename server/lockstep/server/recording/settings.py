"""Settings of recordings: LOCKSTEP_RECORDING__…"""

from pathlib import Path

from pydantic import BaseModel, Field

__all__ = ["RecordingSettings", "recordings_directory"]


class RecordingSettings(BaseModel):
    """The directory of recordings, and the bounds of it."""

    directory: Path | None = None  # None: `recordings` in the state directory
    automatic: bool = False  # record from the start on, and again after a failure
    file_bytes: int = Field(default=2_000_000_000, ge=1_000_000)  # then the next part begins
    total_bytes: int = Field(default=20_000_000_000, ge=1_000_000)  # of the directory; then the oldest go
    age_days: float = Field(default=30.0, gt=0)  # older ones go
    free_bytes: int = Field(default=500_000_000, ge=0)  # to stay free on the disk; else recording ends
    keyframe_seconds: float = Field(default=4.0, ge=0.5, le=60.0)  # between two keyframes, twice that without room


def recordings_directory(settings: RecordingSettings, state_directory: Path) -> Path:
    return settings.directory or state_directory / "recordings"
