"""What can go wrong with media.

MediaError
├── PayloadError            the payload of a medium is not what its header says
├── UnsupportedCodecError   a codec that this stream cannot take in or send out
└── EncodeError             a codec library refused a picture or sound
"""

__all__ = ["EncodeError", "MediaError", "PayloadError", "UnsupportedCodecError"]


class MediaError(Exception):
    """Base of all media errors.

    Attributes:
        name: stable, lower-case identifier; the `stage` of the drop counter
        detail: what exactly was wrong, for a person
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
