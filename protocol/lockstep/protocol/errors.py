"""What can go wrong on the robot link.

LinkError
├── FramingError            the byte stream is not frames (length bound, truncation)
├── MessageError            a frame is not a message of the protocol
├── HandshakeError          the two sides cannot work together
├── LinkRefused             the bridge said no to our hello
├── SecretError             the link's secret or TLS files are no good
└── LinkLost                the connection ended or went silent
"""

__all__ = ["FramingError", "HandshakeError", "LinkError", "LinkLost", "LinkRefused", "MessageError", "SecretError"]


class LinkError(Exception):
    """Base of all robot link errors.

    Attributes:
        name: stable, lower-case identifier, used in metrics and on the wire
        detail: what exactly was wrong, for a person
    """

    name = "link"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}"


class FramingError(LinkError):
    name = "framing"


class MessageError(LinkError):
    name = "message"


class HandshakeError(LinkError):
    name = "handshake"


class LinkRefused(LinkError):
    name = "refused"


class SecretError(LinkError):
    name = "secret"


class LinkLost(LinkError):
    name = "lost"
