"""The times of a picture at the console, from its arrival until its packets are made. No I/O, no clock."""

from typing import NamedTuple

import msgspec

from lockstep.protocol.traces.trace import PictureSpans, join_spans, span_ms, spans_at_bridge

__all__ = ["PictureSpanTimes"]


class PictureSpanTimes(NamedTuple):
    """Made with every encoded picture and shared by all peers, so it only keeps times; spans are made when asked for.

    All times are in s on this machine's monotonic clock.
    """

    source: PictureSpans | msgspec.UnsetType  # as its source measured them
    arrived: float  # at the console
    began: float  # its encoder
    encoded: float
    packetised: float

    def spans(self, sent: float | None = None) -> PictureSpans:
        """Return the spans so far. `sent`: when its packets were handed to the network; None: not known."""
        own = PictureSpans(
            encoder_wait_ms=span_ms(self.began - self.arrived),
            encode_ms=span_ms(self.encoded - self.began),
            packetise_ms=span_ms(self.packetised - self.encoded),
            send_ms=msgspec.UNSET if sent is None else span_ms(sent - self.packetised),
        )
        return own if self.source is msgspec.UNSET else join_spans(spans_at_bridge(self.source), own)
