"""Settings of the media plane."""

from typing import Literal

from pydantic import BaseModel, Field

__all__ = ["MediaSettings"]


class MediaSettings(BaseModel):
    """How pictures and sound are encoded and sent."""

    video_bitrate_bps: int = Field(default=800_000, ge=50_000, le=20_000_000)  # of a camera, at most
    quality: bool = True  # follow the network; False: everybody gets everything, whatever arrives
    quality_start_bps: int = Field(default=300_000, ge=50_000, le=20_000_000)  # all cameras, while nothing is known
    quality_min_bps: int = Field(default=80_000, ge=20_000, le=20_000_000)  # all cameras
    crowd_observers: int = Field(default=60, ge=1, le=100_000)  # who watch directly; more get fewer pictures each
    video_frames_per_second: float | None = Field(default=None, ge=1, le=120)  # at most; None: as the camera gives
    keyframe_interval_seconds: float = Field(default=10.0, ge=0.5, le=300.0)
    keyframe_spacing_seconds: float = Field(default=0.3, ge=0.0, le=10.0)  # least time between two requested keyframes
    sound_codecs: tuple[Literal["opus", "PCMU"], ...] = Field(default=("opus", "PCMU"), min_length=1)  # answered
    opus_bitrate_bps: int = Field(default=32_000, ge=6_000, le=256_000)
    opus_packet_loss_percent: int = Field(default=10, ge=0, le=100)  # in-band FEC is sized for it at first
    video_queue_frames: int = Field(default=6, ge=1, le=100)  # pictures that may wait for one peer
    audio_queue_frames: int = Field(default=10, ge=1, le=100)  # sound packets that may wait for one peer
