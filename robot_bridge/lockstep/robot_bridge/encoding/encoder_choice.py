"""The encoders that `--encode` can name, and whether PyAV is there to run them."""

import importlib.util
import logging
from dataclasses import dataclass

from lockstep.robot_bridge.errors import EncoderMissing, SettingsError

__all__ = ["ENCODERS", "SOFTWARE", "EncodeSettings", "encode_settings", "log_fallback"]

SOFTWARE = "libx264"
# name in settings -> name in FFmpeg
ENCODERS = {
    "h264": SOFTWARE,
    "h264_v4l2m2m": "h264_v4l2m2m",  # Raspberry Pi 4 and other boards with a stateful encoder in the kernel
    "h264_nvenc": "h264_nvenc",  # NVIDIA
    "h264_qsv": "h264_qsv",  # Intel
}

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class EncodeSettings:
    """How the bridge encodes."""

    encoder: str = SOFTWARE  # FFmpeg's name; SOFTWARE takes its place if it cannot be opened


def encode_settings(name: str) -> EncodeSettings:
    """Return the settings for one of ENCODERS.

    Raises:
        SettingsError: there is no encoder of that name.
        EncoderMissing: PyAV is not installed.
    """
    if name not in ENCODERS:
        raise SettingsError(f"--encode {name}: there is no such encoder; use {', '.join(ENCODERS)}")
    if importlib.util.find_spec("av") is None:
        raise EncoderMissing("--encode needs PyAV; install lockstep-bridge[encode]")
    return EncodeSettings(ENCODERS[name])


def log_fallback(why: str) -> None:
    """Log why the software encoder takes the place of the one in the settings."""
    _logger.warning("encoder_fallback: %s; %s takes its place", why, SOFTWARE)
