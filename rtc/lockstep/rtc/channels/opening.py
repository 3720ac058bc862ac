"""How channels open: by DATA_CHANNEL_OPEN and its answer (RFC 8832)."""

from collections import Counter

from lockstep.rtc.channels.channel_table import ChannelState, ChannelTable
from lockstep.rtc.channels.closing import ChannelClosing
from lockstep.rtc.dcep import ACK, DcepError, Open, decode_open
from lockstep.rtc.sctp import Association, State

__all__ = ["DCEP", "ChannelOpening"]

DCEP = 50  # PPID, RFC 8831 8


class ChannelOpening:
    """Opens channels of both ends."""

    def __init__(
        self, table: ChannelTable, association: Association, closing: ChannelClosing, counts: Counter[str]
    ) -> None:
        self._table = table
        self._association = association
        self._closing = closing
        self._counts = counts

    def open(self, what: Open, now: float) -> int:
        """Open a channel of this end, and return its stream."""
        message = what.encode()
        stream = self._table.free_stream()
        self._association.send(stream, DCEP, message, now)
        self._table.add(stream, what, ChannelState.CONNECTING)
        return stream

    def receive(self, stream: int, payload: bytes, now: float) -> None:
        """Take a message of DCEP."""
        if payload == ACK:
            channel = self._table.channels.get(stream)
            if channel is not None and channel.state is ChannelState.CONNECTING:
                self._table.opened(channel)
            return
        try:
            what = decode_open(payload)
        except DcepError:
            self._refuse(stream, "dcep_malformed", now)
            return
        refusal = self._table.refusal(stream)
        if refusal:
            self._refuse(stream, refusal, now)
        elif self._association.state is not State.ESTABLISHED:
            self._counts["unexpected"] += 1  # it is shutting down
        else:
            added = self._table.add(stream, what, ChannelState.OPEN, by_peer=True)
            self._association.send(stream, DCEP, ACK, now)
            self._table.opened(added)

    def _refuse(self, stream: int, why: str, now: float) -> None:
        """Close the channel, and do not answer (RFC 8832 6)."""
        self._counts[why] += 1
        if stream in self._table.channels:
            self._closing.close(stream, now)
        else:
            self._association.reset_streams((stream,), now)
