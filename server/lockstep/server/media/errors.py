"""Errors of the media pipeline.

MediaError
├── PayloadError            the payload of a medium does not match its header
├── UnsupportedCodecError   a codec that this stream cannot take in or send out
└── EncodeError             a codec library refused a picture or sound
"""

__all__ = ["EncodeError", "MediaError", "PayloadError", "UnsupportedCodecError"]


class MediaError(Exception):
    """Base of all media errors.

    Attributes:
        name: stable, lower-case identifier; the `stage` of the drop counter
        detail: the exact cause, for a person
    """

    name = "media"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}"


class PayloadError(MediaError):
    name = "bad_payload"


class UnsupportedCodecError(MediaError):
    name = "unsupported_codec"


class EncodeError(MediaError):
    name = "encode_failed"
