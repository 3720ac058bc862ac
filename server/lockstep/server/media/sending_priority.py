"""How soon a peer's datagrams leave, and how often it gets sender reports."""

from lockstep.rtc.endpoint import Connection
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.webrtc.datagram_queue import DriverQueue

__all__ = ["SendingPriority"]

REPORTS_OFTEN = 1 / 3  # s


class SendingPriority:
    """The priority of one peer, by what `quality` says of it. Call `apply` when that has changed.

    A round trip shows the queue that the last report met, so a peer on whom the operator's pictures depend gets three
    reports a second: a queue of a few hundred milliseconds has to show before it has grown to a second. On the
    narrowest paths that is a hundredth of the traffic; RTCP may take a twentieth (RFC 4585 3.4).
    """

    def __init__(self, connection: Connection, quality: PeerQuality, turns: DriverQueue | None = None) -> None:
        """`turns` is told whether this peer drives."""
        self._connection = connection
        self._quality = quality
        self._turns = turns
        self._report_seconds = 1.0  # between two sender reports, unless this peer comes first

    def apply(self) -> None:
        quality = self._quality
        comes_first = quality.drives or quality.operator or quality.relays
        if self._turns is not None:
            self._turns.drives = quality.drives
        self._connection.urgent = quality.drives or quality.operator
        self._connection.peer.media.streams.report_every(REPORTS_OFTEN if comes_first else self._report_seconds)

    def report_every(self, seconds: float) -> None:
        """Send a sender report every `seconds`, unless this peer comes first."""
        if seconds != self._report_seconds:
            self._report_seconds = seconds
            self.apply()
