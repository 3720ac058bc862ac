"""An address on a TURN server that stands for this side (RFC 8656), without I/O.

    allocation = Allocation("user", "password", random_bytes)
    allocation.start(now)
    ... then as every core, with the server as the only peer: `receive`, `handle_timer`;
    drain `data_to_send`, `received` and `events`

`ChannelBindings` has the peers that data come from and go to.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from lockstep.rtc.addresses import Address
from lockstep.rtc.stun import Kind, StunError, StunErrorCode, parse_address, transaction_of
from lockstep.rtc.turn.channel_bindings import ChannelBindings
from lockstep.rtc.turn.messages import Attribute, Method
from lockstep.rtc.turn.requests import Answer, Requests
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
        self._requests = Requests(random_bytes, self._settings, username=username, password=password, reliable=reliable)
        self.counts: Counter[str] = self._requests.counts
        self.relayed: Address | None = None  # None: no allocation now
        self._channels = ChannelBindings(self._requests, self._settings, reliable=reliable)
        self._refresh_at: float | None = None
        self._lifetime = self._settings.lifetime  # s, that the server has given
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
        else:
            self._channels.send(data, peer, now)

    def close(self, now: float) -> None:
        """Give the allocation back; drain `data_to_send` once more. Idempotent."""
        if self.relayed is not None:
            self._requests.begin(Method.REFRESH, [(Attribute.LIFETIME, bytes(4))], now)
            self._channels.out += self._requests.data_to_send()
        self._end(None)

    # Input

    def receive(self, data: bytes, now: float) -> None:
        """Take a message from the server."""
        if self._ended:
            self.counts["ended"] += 1
            return
        head = transaction_of(data)
        if head is None:
            self._channels.receive(data)
        elif head[0] is Kind.INDICATION:
            self._channels.receive_indication(data, head[1])
        else:
            self._requests.receive(data, now)
            self._settle(now)

    # Output

    def data_to_send(self) -> list[bytes]:
        """Return the messages for the server."""
        out = self._requests.data_to_send() + self._channels.out
        self._channels.out = []
        return out

    def received(self) -> list[tuple[bytes, Address]]:
        """Return the data that peers have sent to the relayed address, each with its sender."""
        received, self._channels.received = self._channels.received, []
        return received

    def events(self) -> list[Allocated | AllocationEnded]:
        events, self._events = self._events, []
        return events

    def timer(self) -> float | None:
        if self._ended:
            return None
        times = (self._requests.timer(), self._refresh_at, self._channels.timer())
        return min((each for each in times if each is not None), default=None)

    def handle_timer(self, now: float) -> None:
        if self._ended:
            return
        self._requests.handle_timer(now)
        if self._refresh_at is not None and now >= self._refresh_at:
            self._refresh_at = None
            self._requests.begin(Method.REFRESH, [(Attribute.LIFETIME, self._lifetime.to_bytes(4))], now)
        self._channels.handle_timer(now)
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
            else:
                self._channels.answered(answer, now)

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

    def _end(self, error: StunErrorCode | None) -> None:
        if self._ended:
            return
        self._ended, self.relayed, self._refresh_at = True, None, None
        self._requests.forget()
        if error is not None:
            self._events.append(AllocationEnded(error))
