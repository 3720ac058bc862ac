"""One relay as the console sees it: where it is, whether it carries the session now, and since when it does not."""

from dataclasses import dataclass

from lockstep.protocol.console import StreamInfo
from lockstep.server.sfu.relay_url import RelayUrl

__all__ = ["SfuServer"]


@dataclass
class SfuServer:
    """State of one configured relay. `SfuCoordinator` changes it, nobody else."""

    name: str  # its number among the settings: "0"
    url: RelayUrl
    public: str  # the address that observers use: "wss://relay.example.org"
    feed: int = 0  # that observers subscribe to there; 0: it does not carry the session now
    streams: tuple[StreamInfo, ...] = ()
    trouble: str = ""  # why it does not; "" before the first try
    failed_at: float = float("-inf")  # when it was tried last in vain, s on the monotonic clock

    @property
    def live(self) -> bool:
        return self.feed != 0
