"""The errors of this package. Nothing that a peer sends raises anything out of `receive_packet`."""

__all__ = ["AssociationClosed", "MessageTooLarge", "ProtocolViolation", "SctpParseError", "SendQueueFull"]


class SctpParseError(ValueError):
    """The bytes are not an SCTP packet, chunk or parameter. The only error that the parsers raise."""


class ProtocolViolation(Exception):
    """The peer did something after which the association cannot go on. The association turns it into an event.

    `reason` is a stable name.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class AssociationClosed(Exception):
    """The association has ended or is shutting down: nothing more can be sent."""


class MessageTooLarge(ValueError):
    """The message is larger than `SctpSettings.max_send_message`, or than the peer takes."""


class SendQueueFull(Exception):
    """Too many bytes wait on this stream; the message was not taken. Try again when they have left."""
