"""What is wrong with a packet."""

__all__ = ["RtpError"]


class RtpError(ValueError):
    """Bytes that are not the RTP or RTCP packet that they should be. The one error that the parsers raise."""
