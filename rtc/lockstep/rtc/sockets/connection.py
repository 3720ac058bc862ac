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
from lockstep.rtc.sockets.core_timer import CoreTimer
from lockstep.rtc.sockets.endpoint_settings import EndpointSettings
from lockstep.rtc.sockets.event_delivery import EventDelivery, Listener

__all__ = ["Connection", "Turns"]

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
        self._timer = CoreTimer(peer, self.settle, self._fail)
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
        return self.peer.negotiation.offer(media, data=data)

    def accept(self, answer: SessionDescription) -> None:
        self.peer.accept(answer, self._loop.time())
        self.flush()

    def add_candidate(self, line: str) -> None:
        self.peer.negotiation.add_candidate(line)
        self.flush()

    def answer_restart(self, fragment: Fragment) -> Fragment:
        """Like `Negotiation.answer_restart`, with the present candidates of the endpoint."""
        answer = self.peer.negotiation.answer_restart(fragment, self._loop.time(), self._endpoint.candidates)
        self.flush()
        return answer

    def restart(self, candidates: Sequence[LocalCandidate] | None = None) -> Fragment:
        """Like `Negotiation.restart`. `candidates`: None: the present ones of the endpoint."""
        own = self._endpoint.candidates if candidates is None else candidates
        fragment = self.peer.negotiation.restart(self._loop.time(), own)
        self.flush()
        return fragment

    def accept_restart(self, fragment: Fragment) -> None:
        self.peer.negotiation.accept_restart(fragment, self._loop.time())
        self.flush()

    def cancel_restart(self) -> None:
        self.peer.ice.cancel_restart()
        self.flush()

    # Sending, as in `Peer`

    def open_channel(self, label: str, *, protocol: str = "", reliability: Reliability | None = None) -> int:
        now = self._loop.time()
        channel = self.peer.need_channels(now).open(label, now, protocol=protocol, reliability=reliability)
        self.flush()
        return channel

    def open_negotiated_channel(self, channel: int, label: str, *, reliability: Reliability | None = None) -> None:
        """Like `DataChannels.open_negotiated`. Raises PeerNotReady as well."""
        self.peer.need_channels(self._loop.time()).open_negotiated(channel, label, reliability=reliability)

    def send(self, channel: int, data: str | bytes) -> None:
        now = self._loop.time()
        channels = self.peer.need_channels(now)
        channels.send(channel, data, now)
        if self.fault is not None:
            return
        self._endpoint.send(self.peer.datagrams_to_send(), urgent=self.urgent)
        if self.peer.has_events:
            self.flush()
        else:
            self._timer.set_by(channels.timer())

    def close_channel(self, channel: int) -> None:
        now = self._loop.time()
        self.peer.need_channels(now).close(channel, now)
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
        media, path = self.peer.media, self.peer.ice.path
        sent = media.frame_to_send(
            mid, payloads, media_time, now, marker=marker, values=values, captured_at=captured_at
        )
        if path is not None:
            self._endpoint.send([Datagram(data, path) for data in sent], urgent=self.urgent)
        self._timer.set_by(media.due)

    def send_rtcp(self, packet: bytes) -> None:
        self.peer.media.send_rtcp(packet)
        self.flush()

    @property
    def is_blocked(self) -> bool:
        """True if data sent now would only wait for the network. True too while there is no path."""
        path = self.peer.ice.path
        return path is None or self._endpoint.is_blocked(path)

    def request_keyframe(self, mid: str) -> None:
        self.peer.media.request_keyframe(mid, self._loop.time())
        self.flush()

    def limit(self, mid: str, bitrate: int) -> None:
        """Ask the peer to send at most `bitrate` bit/s in this section (REMB). Raises PeerNotReady."""
        self.peer.media.need_incoming(mid).limit = bitrate

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
        with suppress(Exception):
            self.peer.media.end()  # a sender is told; what it sends would never leave
        self._later.clear()
        self._timer.close()
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
            self._timer.set_soon()
        else:
            self._timer.set()
        if self._delivery.ended:
            self._later.clear()
            self._endpoint.forget(self)

    def hand_out_plain(self) -> None:
        """Hand out plain packets, in place of `flush` where only `Peer.receive_plain` was called."""
        self._delivery.hand_out(self.peer.settled_events())

    def _not_read(self) -> None:
        self.peer.close(self._loop.time())
        self._loop.call_soon(self.flush)
