"""Parses `--speaker`: `pulse:[sink]`, `alsa:device` or `file:path.wav`. No I/O."""

from typing import NamedTuple
from urllib.parse import unquote

__all__ = ["BadSpeaker", "SpeakerSpec", "parse_speaker"]

SCHEMES = ("pulse", "alsa", "file")


class BadSpeaker(ValueError):
    """The text names no loudspeaker."""


class SpeakerSpec(NamedTuple):
    scheme: str  # "pulse"
    device: str  # "": the default device


def parse_speaker(text: str) -> SpeakerSpec:
    """Parse the value of `--speaker`. Raises BadSpeaker."""
    scheme, colon, device = text.strip().partition(":")
    if not colon or scheme not in SCHEMES:
        raise BadSpeaker("not pulse:[sink], alsa:device or file:path.wav")
    if scheme == "file" and not device:
        raise BadSpeaker("file: needs a path")
    return SpeakerSpec(scheme, unquote(device) or ("default" if scheme == "alsa" else ""))
