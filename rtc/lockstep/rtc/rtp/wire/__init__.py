"""RTP and RTCP packets as bytes."""
