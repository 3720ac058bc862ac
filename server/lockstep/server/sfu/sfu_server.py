"""The state of one relay: its address, the feed that it carries now, and its last failure."""

from dataclasses import dataclass

from lockstep.protocol.console import StreamInfo
from lockstep.server.sfu.relay_url import RelayUrl

__all__ = ["SfuServer"]


@dataclass
class SfuServer:
    """State of one configured relay. Only `SfuServers` changes it."""

    name: str  # its number among the settings: "0"
    url: RelayUrl
    public: str  # the address that observers use: "wss://relay.example.org"
    feed: int = 0  # feed that observers subscribe to; 0: the relay does not carry the session now
    streams: tuple[StreamInfo, ...] = ()
    trouble: str = ""  # reason that the relay does not carry it; "" before the first try
    failed_at: float = float("-inf")  # last failure, s on the monotonic clock

    @property
    def live(self) -> bool:
        return self.feed != 0
