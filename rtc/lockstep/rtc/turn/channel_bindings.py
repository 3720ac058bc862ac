"""The channels of an allocation, one for each peer (RFC 8656 12): 4 bytes in front of each datagram."""

from collections import Counter, deque
from dataclasses import dataclass, field

from lockstep.rtc.addresses import Address
from lockstep.rtc.stun import StunError, pack_address, parse_address, read_attributes
from lockstep.rtc.turn.messages import (
    CHANNELS,
    MAX_TURN_MESSAGE,
    Attribute,
    Method,
    pack_channel_data,
    parse_channel_data,
)
from lockstep.rtc.turn.requests import TIMEOUT, Answer, Requests
from lockstep.rtc.turn.settings import TurnSettings

__all__ = ["ChannelBindings"]


@dataclass(slots=True, eq=False)
class _Peer:
    address: Address
    channel: int
    bound: bool = False
    bind_at: float | None = None  # the time to bind the channel again
    refused_until: float = 0.0
    waiting: deque[bytes] = field(default_factory=deque)


class ChannelBindings:
    """Binds a channel to each peer that data are sent to, which is the peer's permission as well, and keeps it bound.

    `out` has messages for the server, `received` data with their senders; both are drained by their owner.
    """

    def __init__(self, requests: Requests, settings: TurnSettings, *, reliable: bool) -> None:
        """`reliable`: as in `Allocation`."""
        self.out: list[bytes] = []
        self.received: list[tuple[bytes, Address]] = []
        self._requests = requests
        self._settings = settings
        self._reliable = reliable
        self._counts: Counter[str] = requests.counts
        self._peers: dict[Address, _Peer] = {}
        self._by_channel: dict[int, _Peer] = {}

    def send(self, data: bytes, address: Address, now: float) -> None:
        peer = self._peers.get(address) or self._add(address)
        if peer is None or now < peer.refused_until:
            self._counts["peers" if peer is None else "refused"] += 1
        elif peer.bound:
            self.out.append(pack_channel_data(peer.channel, data, padded=self._reliable))
        else:
            peer.waiting.append(data)
            if len(peer.waiting) > self._settings.max_waiting:
                peer.waiting.popleft()
                self._counts["waiting"] += 1
            if not self._requests.is_pending(peer):
                self._bind(peer, now)

    def _add(self, address: Address) -> _Peer | None:
        if len(self._peers) >= self._settings.max_peers:
            return None
        peer = _Peer(address, CHANNELS[len(self._peers)])
        self._peers[address] = self._by_channel[peer.channel] = peer
        return peer

    def _bind(self, peer: _Peer, now: float) -> None:
        """Bind a channel (RFC 8656 12.1)."""
        peer.bind_at = None
        # XOR with the transaction changes IPv6 addresses only, and a relayed address of IPv4 has no peers of IPv6.
        address = (Attribute.XOR_PEER_ADDRESS, pack_address(peer.address, bytes(12)))
        number = (Attribute.CHANNEL_NUMBER, (peer.channel << 16).to_bytes(4))
        self._requests.begin(Method.CHANNEL_BIND, [number, address], now, peer)

    def answered(self, answer: Answer, now: float) -> None:
        """Take the server's answer to a request of this object."""
        peer = answer.request.subject
        assert isinstance(peer, _Peer)
        if answer.error is not None and answer.error.code == TIMEOUT.code:
            peer.bind_at = now + self._settings.refresh_again if peer.bound else None
            peer.waiting.clear()
            return
        peer.bound = answer.error is None
        if answer.error is None:
            peer.bind_at = now + self._settings.rebind_interval
            for data in peer.waiting:
                self.out.append(pack_channel_data(peer.channel, data, padded=self._reliable))
        else:
            self._counts[f"bind_refused_{answer.error.code}"] += 1
            peer.refused_until = now + self._settings.refused_seconds
        peer.waiting.clear()

    def receive(self, data: bytes) -> None:
        """Take ChannelData."""
        parsed = parse_channel_data(data)
        peer = self._by_channel.get(parsed[0]) if parsed is not None else None
        if parsed is None or peer is None:
            self._counts["malformed" if parsed is None else "unknown_channel"] += 1
        else:
            self.received.append((parsed[1], peer.address))

    def receive_indication(self, data: bytes, transaction: bytes) -> None:
        """Take data of a peer from before its channel is bound. Only peers with a permission count."""
        try:
            attributes = read_attributes(data, MAX_TURN_MESSAGE)
            address = parse_address(attributes.get(Attribute.XOR_PEER_ADDRESS), transaction)
        except StunError:
            self._counts["malformed"] += 1
            return
        content = attributes.get(Attribute.DATA)
        if address not in self._peers or content is None:
            self._counts["indication"] += 1
        else:
            self.received.append((content, address))

    def timer(self) -> float | None:
        return min((each.bind_at for each in self._peers.values() if each.bind_at is not None), default=None)

    def handle_timer(self, now: float) -> None:
        for peer in self._peers.values():
            if peer.bind_at is not None and now >= peer.bind_at:
                self._bind(peer, now)
