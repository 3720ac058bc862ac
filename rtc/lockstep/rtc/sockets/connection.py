"""One connection of an endpoint: a peer with a clock and a way to the sockets."""

import asyncio
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Protocol, Self

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.peer import OfferedMedia, Peer
from lockstep.rtc.peer_events import PeerEnded, PeerEvent
from lockstep.rtc.sdp import Fragment, LocalMedia, SessionDescription
from lockstep.rtc.sockets.endpoint_settings import EndpointSettings
from lockstep.rtc.sockets.event_delivery import EventDelivery, Listener

__all__ = ["Connection", "Turns"]

CLOCK_RESOLUTION = 0.001  # s; a loop may call too early by so much
PASSES = (
    4  # a channel is empty now, or a datagram had further records; what is left waits for the next datagram or timer
)


class SocketSide(Protocol):
    """The part of an endpoint that a connection needs."""

    @property
    def candidates(self) -> list[LocalCandidate]:
        """The local addresses for the peer now."""
        ...

    def send(self, datagrams: Sequence[Datagram], *, urgent: bool) -> None:
        """Send datagrams with all others of this turn of the loop; urgent ones now."""

    def is_blocked(self, path: Path) -> bool:
        """True if data sent on this path now would only wait for the network."""
        ...

    def forget(self, connection: "Connection") -> None:
        """Note that a connection has ended."""


class Turns(Protocol):
    """Gives connections their turns: the packets of their peers are handled in turn, and delay no other connection."""

    def may_go_at_once(self) -> bool:
        """True if one datagram more need not wait. Asked only where none waits."""

    def add(self, connection: "Connection") -> None:
        """Give `connection` turns: call its `handle_next` until that returns False. It may be waiting already."""


class Connection:
    """One peer: `lockstep.rtc.peer.Peer` with a clock and a socket.

    Read its events with `async for`, once; or pass a listener, which gets each event as it happens.
    """

    def __init__(
        self,
        endpoint: SocketSide,
        peer: Peer,
        settings: EndpointSettings,
        listener: Listener | None = None,
        turns: Turns | None = None,
    ) -> None:
        self.peer = peer
        self.urgent = False  # True: its datagrams leave before those of others
        self.counts: Counter[str] = Counter()
        self._endpoint = endpoint
        self._settings = settings
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0.0
        self._sets_timer = False  # True: the loop calls `_set_timer_now` in its next turn
        self._turns = turns
        self._later: deque[tuple[bytes, Path]] = deque()  # datagrams that wait for their turn
        self.fault: Exception | None = None  # the exception that serving it raised, after PeerEnded("failed")
        self._delivery = EventDelivery(listener, settings, self.counts, self._not_read)

    # Negotiation, as in `Peer`

    def answer(self, offer: SessionDescription, media: Mapping[str, LocalMedia]) -> SessionDescription:
        answer = self.peer.answer(offer, media, self._loop.time())
        self.flush()
        return answer

    def offer(self, media: Sequence[OfferedMedia] = (), *, data: bool = True) -> SessionDescription:
        return self.peer.offer(media, data=data)

    def accept(self, answer: SessionDescription) -> None:
        self.peer.accept(answer, self._loop.time())
        self.flush()

    def add_candidate(self, line: str) -> None:
        self.peer.add_candidate(line)
        self.flush()

    def answer_restart(self, fragment: Fragment) -> Fragment:
        """Like `Peer.answer_restart`, with the present candidates of the endpoint."""
        answer = self.peer.answer_restart(fragment, self._loop.time(), self._endpoint.candidates)
        self.flush()
        return answer

    def restart(self, candidates: Sequence[LocalCandidate] | None = None) -> Fragment:
        """Like `Peer.restart`. `candidates`: None: the present ones of the endpoint."""
        fragment = self.peer.restart(self._loop.time(), self._endpoint.candidates if candidates is None else candidates)
        self.flush()
        return fragment

    def accept_restart(self, fragment: Fragment) -> None:
        self.peer.accept_restart(fragment, self._loop.time())
        self.flush()

    def cancel_restart(self) -> None:
        self.peer.cancel_restart()
        self.flush()

    # Sending, as in `Peer`

    def open_channel(self, label: str, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        channel = self.peer.open_channel(label, self._loop.time(), protocol=protocol, reliability=reliability)
        self.flush()
        return channel

    def send(self, channel: int, data: str | bytes) -> None:
        self.peer.send(channel, data, self._loop.time())
        if self.fault is not None:
            return
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        if self.peer.has_events:
            self.flush()
        else:
            self._set_timer_by(self.peer.channel_timer)

    def close_channel(self, channel: int) -> None:
        self.peer.close_channel(channel, self._loop.time())
        self.flush()

    def send_frame(
        self,
        mid: str,
        payloads: Sequence[bytes],
        media_time: int,
        *,
        marker: bool = True,
        values: Mapping[str, bytes] | None = None,
        captured_at: float | None = None,
    ) -> None:
        now = self._loop.time()
        datagrams = self.peer.frame_to_send(
            mid, payloads, media_time, now, marker=marker, values=values, captured_at=captured_at
        )
        self._endpoint.send(datagrams, urgent=self.urgent)
        self._set_timer_by(self.peer.media_timer)

    def send_rtcp(self, packet: bytes) -> None:
        self.peer.send_rtcp(packet)
        self.flush()

    @property
    def is_blocked(self) -> bool:
        """True if data sent now would only wait for the network. True too while there is no path."""
        path = self.peer.ice.path
        return path is None or self._endpoint.is_blocked(path)

    def request_keyframe(self, mid: str) -> None:
        self.peer.request_keyframe(mid, self._loop.time())
        self.flush()

    def limit(self, mid: str, bitrate: int) -> None:
        self.peer.limit(mid, bitrate)

    def close(self) -> None:
        """Say goodbye. The events end with PeerEnded("closed")."""
        if self.fault is None:
            try:
                self.peer.close(self._loop.time())
                self.flush()
            except Exception as error:
                self._fail(error)

    # Events

    def listen(self, listener: Listener) -> None:
        """Pass all further events to `listener`, after those that nobody has read. Only once."""
        self._delivery.listen(listener)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> PeerEvent:
        return await self._delivery.next_event()

    # Turns

    def handle_next(self) -> bool:
        """Handle one of the datagrams that wait. Return True if more wait."""
        if self._later:
            data, path = self._later.popleft()
            if self.receive(data, path, self._loop.time()):
                self.settle()
            else:
                self.hand_out_plain()
        return bool(self._later)

    # Inside

    def put_off(self, data: bytes, path: Path) -> bool:
        """Let a datagram wait for its turn; drop it if too many wait. Return False if it is to be handled now."""
        if self._turns is None or (not self._later and self._turns.may_go_at_once()):
            return False
        if len(self._later) < self._settings.waiting_datagrams:
            self._later.append((data, path))
            self._turns.add(self)
        else:
            self.counts["receive_overflow"] += 1
        return True

    def receive(self, data: bytes, path: Path, now: float) -> bool:
        """Handle a datagram. Call `settle` then, or `hand_out_plain` if this returns False: it was a plain packet."""
        try:
            if self.peer.receive_plain(data):
                return False
            self.peer.receive_datagram(data, path, now)
        except Exception as error:
            self._fail(error)
        return True

    def path_closed(self, path: Path) -> None:
        """Note that the TCP connection of this path has ended."""
        try:
            self.peer.ice.path_closed(path, self._loop.time())
            self.flush()
        except Exception as error:
            self._fail(error)

    def settle(self) -> None:
        """Do as `flush` after `receive`; an exception ends this connection and no other."""
        if self.fault is None:
            try:
                self._finish(self.peer.settled_events())
            except Exception as error:
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        """End this connection after unexpected input: a fault of this package, which other peers must not feel.

        A listener finds the exception in `fault`; without a listener, the loop's exception handler is told.
        """
        if self.fault is not None:
            return
        self.fault = error
        if not self._delivery.has_listener:
            self._loop.call_exception_handler({"message": "serving a WebRTC peer failed", "exception": error})
        with suppress(Exception):
            self.peer.ice.close()
        self._later.clear()
        if self._timer is not None:
            self._timer.cancel()
        self._delivery.hand_out([PeerEnded("failed", str(error))])
        self._endpoint.forget(self)

    def flush(self) -> None:
        """Send the due datagrams, hand out the events, and set the timer anew. Call it after using `peer` directly."""
        if self.fault is None:
            self._finish(self.peer.events())

    def _finish(self, events: Sequence[PeerEvent]) -> None:
        self._delivery.hand_out(events)
        self.peer.read_on()
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        for _ in range(PASSES):
            if not self.peer.has_events:
                break
            self._delivery.hand_out(self.peer.events())
            self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        if self.urgent and not self._delivery.ended:
            self._set_timer_soon()
        else:
            self._set_timer()
        if self._delivery.ended:
            self._later.clear()
            self._endpoint.forget(self)

    def hand_out_plain(self) -> None:
        """Hand out plain packets, in place of `flush` where only `Peer.receive_plain` was called."""
        self._delivery.hand_out(self.peer.settled_events())

    def _not_read(self) -> None:
        self.peer.close(self._loop.time())
        self._loop.call_soon(self.flush)

    def _set_timer_soon(self) -> None:
        """Set the timer behind everything that this turn of the loop has woken, which may wait for a feedback."""
        if not self._sets_timer:
            self._sets_timer = True
            self._loop.call_soon(self._set_timer_now)

    def _set_timer_now(self) -> None:
        self._sets_timer = False
        if self.fault is None:
            try:
                self._set_timer()
            except Exception as error:
                self._fail(error)

    def _set_timer(self) -> None:
        """Set the timer anew. One that fires too early is left: the next datagram puts off most of them, and no code
        waits for them."""
        due = self.peer.timer()
        if due is None and self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._set_timer_by(due)

    def _set_timer_by(self, due: float | None) -> None:
        """Let the timer fire at `due` at the latest."""
        if due is None or (self._timer is not None and self._timer_at <= due):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._timer_at = self._loop.call_at(due, self._due), due

    def _due(self) -> None:
        self._timer = None
        due, now = self.peer.timer(), self._loop.time()
        if due is None or due > now + CLOCK_RESOLUTION:
            self._set_timer()
            return
        try:
            self.peer.handle_timer(max(now, due))
        except Exception as error:
            self._fail(error)
        self.settle()
