"""Settings of the media hub."""

from typing import Literal

from pydantic import BaseModel, Field

__all__ = ["MediaSettings"]


class MediaSettings(BaseModel):
    """Settings for encoding and sending pictures and sound."""

    video_bitrate_bps: int = Field(default=800_000, ge=50_000, le=20_000_000)  # per camera, at most
    quality: bool = True  # adapt to the network; False: every peer gets full quality, whatever gets through
    quality_start_bps: int = Field(default=300_000, ge=50_000, le=20_000_000)  # all cameras, until the path is known
    quality_min_bps: int = Field(default=80_000, ge=20_000, le=20_000_000)  # all cameras together
    crowd_observers: int = Field(default=60, ge=1, le=100_000)  # direct observers; with more, each gets fewer pictures
    video_frames_per_second: float | None = Field(default=None, ge=1, le=120)  # at most; None: the camera's own rate
    keyframe_interval_seconds: float = Field(default=10.0, ge=0.5, le=300.0)
    keyframe_spacing_seconds: float = Field(default=0.3, ge=0.0, le=10.0)  # least time between two requested keyframes
    sound_codecs: tuple[Literal["opus", "PCMU"], ...] = Field(default=("opus", "PCMU"), min_length=1)  # in answers
    opus_bitrate_bps: int = Field(default=32_000, ge=6_000, le=256_000)
    opus_packet_loss_percent: int = Field(default=10, ge=0, le=100)  # initial value; in-band FEC is sized for it
    # A robot that encodes makes another encoding for observers while the operator's path is narrow, of what the
    # operator's leaves of the robot's uplink (docs/quality.md, "The second encoding").
    second_encoding: bool = False
    video_queue_frames: int = Field(default=6, ge=1, le=100)  # pictures that may wait for one peer
    audio_queue_frames: int = Field(default=10, ge=1, le=100)  # sound packets that may wait for one peer
