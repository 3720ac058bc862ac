"""What can be wrong with published media.

PublishedMediaError
└── BadPayload   the payload of a packet is none of its codec
"""

__all__ = ["BadPayload", "PublishedMediaError"]


class PublishedMediaError(Exception):
    """Base of all."""


class BadPayload(PublishedMediaError):
    """The payload of an RTP packet is none of its codec."""
