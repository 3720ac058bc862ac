"""How channels close: both ends reset their stream (RFC 8831 6.7)."""

from lockstep.rtc.channels.backlog import Backlog
from lockstep.rtc.channels.channel_table import Channel, ChannelState, ChannelTable
from lockstep.rtc.sctp import Association

__all__ = ["ChannelClosing"]


class ChannelClosing:
    """`waiting`: channels whose streams are to be reset when nothing waits on them."""

    def __init__(self, table: ChannelTable, association: Association, backlog: Backlog) -> None:
        self.waiting: set[int] = set()
        self._table = table
        self._association = association
        self._backlog = backlog

    def close(self, stream: int, now: float) -> None:
        """Close a channel when its waiting messages have left. No effect on one that does not exist."""
        channel = self._table.channels.get(stream)
        if channel is not None and channel.state is not ChannelState.CLOSING:
            channel.state = ChannelState.CLOSING
            self.waiting.add(stream)
            self.reset_ready(now)

    def reset_ready(self, now: float) -> bool:
        """Reset the closing channels on which nothing waits. Return True if there were any."""
        ready = tuple(stream for stream in self.waiting if not self._association.has_waiting(stream))
        self.waiting.difference_update(ready)
        if ready and not self._association.reset_streams(ready, now):
            for stream in ready:
                self._remove(stream)
        return bool(ready)

    def reset_by_peer(self, streams: tuple[int, ...], now: float) -> None:
        """Note that the peer has reset its streams; none named: all."""
        for stream in streams or tuple(self._table.channels):
            channel = self._table.channels.get(stream)
            if channel is not None:
                channel.incoming_reset = True
                self.close(stream, now)
                self._remove_when_reset(channel)

    def reset_here(self, streams: tuple[int, ...]) -> None:
        """Note that the peer has answered the reset of these streams."""
        for stream in streams:
            channel = self._table.channels.get(stream)
            if channel is not None:
                channel.outgoing_reset = True
                self._remove_when_reset(channel)

    def clear(self) -> None:
        """Wait for nothing: the association has ended."""
        self.waiting.clear()

    def _remove_when_reset(self, channel: Channel) -> None:
        if channel.outgoing_reset and channel.incoming_reset:
            self._remove(channel.stream)

    def _remove(self, stream: int) -> None:
        self._table.remove(stream)
        self._backlog.forget(stream)
