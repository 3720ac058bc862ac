"""Errors of the RTP and RTCP parsers."""

__all__ = ["RtpError"]


class RtpError(ValueError):
    """The bytes are not the RTP or RTCP packet that they should be. The only error that the parsers raise."""
