"""An address on a TURN server that stands for this side (RFC 8656), without I/O.

    allocation = Allocation("user", "password", random_bytes)
    allocation.start(now)
    ... then as every core, with the server as the only peer: `receive`, `handle_timer`;
    drain `data_to_send`, `received` and `events`

Every peer gets a channel, which is its permission as well (RFC 8656 12): 4 bytes in front of each datagram.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from lockstep.rtc.addresses import Address
from lockstep.rtc.stun import (
    Kind,
    StunError,
    StunErrorCode,
    pack_address,
    parse_address,
    read_attributes,
    transaction_of,
)
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

__all__ = ["Allocated", "Allocation", "AllocationEnded"]

UDP = b"\x11\x00\x00\x00"  # REQUESTED-TRANSPORT (RFC 8656 18.8)
BAD_ANSWER = StunErrorCode(500, "an answer that lacks something")
GONE = (437, 403)  # to a refresh: the server knows the allocation no more (RFC 8656 7.3), or not with these credentials


@dataclass(frozen=True, slots=True)
class Allocated:
    """Peers reach this side at `relayed` from now on."""

    relayed: Address
    mapped: Address | None  # the address of this side, as the server sees it


@dataclass(frozen=True, slots=True)
class AllocationEnded:
    """There is no allocation, or it ended; the last event. `error`: the server's answer; 408 without one."""

    error: StunErrorCode


@dataclass(slots=True, eq=False)
class _Peer:
    address: Address
    channel: int
    bound: bool = False
    bind_at: float | None = None  # the time to bind the channel again
    refused_until: float = 0.0
    waiting: deque[bytes] = field(default_factory=deque)


class Allocation:
    """One allocation. `counts`: dropped datagrams, by reason: "peers", "refused", "waiting", "not_allocated",
    "malformed", …"""

    def __init__(
        self,
        username: str,
        password: str,
        random_bytes: Callable[[int], bytes],
        *,
        reliable: bool = False,
        settings: TurnSettings | None = None,
    ) -> None:
        """`reliable`: the server is reached by TCP or TLS; hand in the messages that `TurnStream` finds."""
        self._settings = settings or TurnSettings()
        self._reliable = reliable
        self._requests = Requests(random_bytes, self._settings, username=username, password=password, reliable=reliable)
        self.counts: Counter[str] = self._requests.counts
        self.relayed: Address | None = None  # None: no allocation now
        self._peers: dict[Address, _Peer] = {}
        self._by_channel: dict[int, _Peer] = {}
        self._refresh_at: float | None = None
        self._lifetime = self._settings.lifetime  # s, that the server has given
        self._out: list[bytes] = []
        self._received: list[tuple[bytes, Address]] = []
        self._events: list[Allocated | AllocationEnded] = []
        self._ended = False

    def start(self, now: float) -> None:
        """Ask for the allocation. Allocated or AllocationEnded follows."""
        lifetime = self._settings.lifetime.to_bytes(4)
        attributes = [(Attribute.REQUESTED_TRANSPORT, UDP), (Attribute.LIFETIME, lifetime)]
        self._requests.begin(Method.ALLOCATE, attributes, now)

    def send(self, data: bytes, peer: Address, now: float) -> None:
        """Send from the relayed address. Data that cannot go now wait a little, or are dropped and counted."""
        if self.relayed is None:
            self.counts["not_allocated"] += 1
            return
        known = self._peers.get(peer) or self._add(peer)
        if known is None or now < known.refused_until:
            self.counts["peers" if known is None else "refused"] += 1
        elif known.bound:
            self._out.append(pack_channel_data(known.channel, data, padded=self._reliable))
        else:
            known.waiting.append(data)
            if len(known.waiting) > self._settings.max_waiting:
                known.waiting.popleft()
                self.counts["waiting"] += 1
            if not self._requests.is_pending(known):
                self._bind(known, now)

    def close(self, now: float) -> None:
        """Give the allocation back; drain `data_to_send` once more. Idempotent."""
        if self.relayed is not None:
            self._requests.begin(Method.REFRESH, [(Attribute.LIFETIME, bytes(4))], now)
            self._out += self._requests.data_to_send()
        self._end(None)

    # Input

    def receive(self, data: bytes, now: float) -> None:
        """Take a message from the server."""
        if self._ended:
            self.counts["ended"] += 1
            return
        head = transaction_of(data)
        if head is None:
            self._receive_channel_data(data)
        elif head[0] is Kind.INDICATION:
            self._receive_indication(data, head[1])
        else:
            self._requests.receive(data, now)
            self._settle(now)

    def _receive_channel_data(self, data: bytes) -> None:
        parsed = parse_channel_data(data)
        peer = self._by_channel.get(parsed[0]) if parsed is not None else None
        if parsed is None or peer is None:
            self.counts["malformed" if parsed is None else "unknown_channel"] += 1
        else:
            self._received.append((parsed[1], peer.address))

    def _receive_indication(self, data: bytes, transaction: bytes) -> None:
        """Take data of a peer from before its channel is bound. Only peers with a permission count."""
        try:
            attributes = read_attributes(data, MAX_TURN_MESSAGE)
            address = parse_address(attributes.get(Attribute.XOR_PEER_ADDRESS), transaction)
        except StunError:
            self.counts["malformed"] += 1
            return
        content = attributes.get(Attribute.DATA)
        if address not in self._peers or content is None:
            self.counts["indication"] += 1
        else:
            self._received.append((content, address))

    # Output

    def data_to_send(self) -> list[bytes]:
        """Return the messages for the server."""
        out = self._requests.data_to_send() + self._out
        self._out = []
        return out

    def received(self) -> list[tuple[bytes, Address]]:
        """Return the data that peers have sent to the relayed address, each with its sender."""
        received, self._received = self._received, []
        return received

    def events(self) -> list[Allocated | AllocationEnded]:
        events, self._events = self._events, []
        return events

    def timer(self) -> float | None:
        if self._ended:
            return None
        times = [self._requests.timer(), self._refresh_at, *(each.bind_at for each in self._peers.values())]
        return min((each for each in times if each is not None), default=None)

    def handle_timer(self, now: float) -> None:
        if self._ended:
            return
        self._requests.handle_timer(now)
        if self._refresh_at is not None and now >= self._refresh_at:
            self._refresh_at = None
            self._requests.begin(Method.REFRESH, [(Attribute.LIFETIME, self._lifetime.to_bytes(4))], now)
        for peer in self._peers.values():
            if peer.bind_at is not None and now >= peer.bind_at:
                self._bind(peer, now)
        self._settle(now)

    # Answers

    def _settle(self, now: float) -> None:
        for answer in self._requests.answers():
            if self._ended:
                return
            if answer.request.method == Method.ALLOCATE:
                self._allocate_answered(answer, now)
            elif answer.request.method == Method.REFRESH:
                self._refresh_answered(answer, now)
            elif isinstance(answer.request.subject, _Peer):
                self._bind_answered(answer.request.subject, answer, now)

    def _allocate_answered(self, answer: Answer, now: float) -> None:
        if answer.error is not None:
            self._end(answer.error)
            return
        try:
            relayed, mapped = (
                parse_address(answer.attributes.get(kind), answer.request.transaction)
                for kind in (Attribute.XOR_RELAYED_ADDRESS, Attribute.XOR_MAPPED_ADDRESS)
            )
        except StunError:
            relayed = mapped = None
        if relayed is None:
            self._end(BAD_ANSWER)
            return
        self.relayed = relayed
        self._note_lifetime(answer, now)
        self._events.append(Allocated(relayed, mapped))

    def _note_lifetime(self, answer: Answer, now: float) -> None:
        given = answer.attributes.get(Attribute.LIFETIME, b"")
        # Coturn bounds it in the first answer only: a later request for more gets a larger number than is kept.
        self._lifetime = min(int.from_bytes(given), self._lifetime) if len(given) == 4 else self._lifetime
        self._refresh_at = now + max(1.0, self._settings.refresh_share * self._lifetime)

    def _refresh_answered(self, answer: Answer, now: float) -> None:
        if answer.error is None:
            self._note_lifetime(answer, now)
        elif answer.error.code in GONE:
            self._end(answer.error)
        else:
            self._refresh_at = now + self._settings.refresh_again

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

    def _bind_answered(self, peer: _Peer, answer: Answer, now: float) -> None:
        if answer.error is not None and answer.error.code == TIMEOUT.code:
            peer.bind_at = now + self._settings.refresh_again if peer.bound else None
            peer.waiting.clear()
            return
        peer.bound = answer.error is None
        if answer.error is None:
            peer.bind_at = now + self._settings.rebind_interval
            for data in peer.waiting:
                self._out.append(pack_channel_data(peer.channel, data, padded=self._reliable))
        else:
            self.counts[f"bind_refused_{answer.error.code}"] += 1
            peer.refused_until = now + self._settings.refused_seconds
        peer.waiting.clear()

    def _end(self, error: StunErrorCode | None) -> None:
        if self._ended:
            return
        self._ended, self.relayed, self._refresh_at = True, None, None
        self._requests.forget()
        if error is not None:
            self._events.append(AllocationEnded(error))
