"""The media of one BUNDLE, encrypted: streams of packets behind SRTP, without I/O."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from lockstep.rtc.bundle.settings import PeerNotReady
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.peer_events import MediaEvent, PacketReceived, PeerEvent, PlainRtcp, PlainRtp
from lockstep.rtc.rtp.incoming import IncomingStream
from lockstep.rtc.rtp.stage import earliest
from lockstep.rtc.rtp.streams import Streams
from lockstep.rtc.srtp import SrtpKeys, SrtpPacketTooLong, SrtpReceiver, SrtpSender

__all__ = ["BundleMedia"]


class BundleMedia:
    """Set `streams` when they are negotiated, then call `connected`. After each call, drain `datagrams_to_send` and
    `events`, and ask for `timer`.

    `due` is the timer as far as it is known without asking the streams. `plain`: True if packets are handed out
    decrypted and unread, as PlainRtp and PlainRtcp, for a receiver that only counts. Then this package sends no
    reports on them, and no requests for missing ones.
    """

    def __init__(self, streams: Streams, counts: Counter[str]) -> None:
        """`streams`: those before the negotiation, which are none. `counts`: those of the peer."""
        self.streams = streams
        self.due: float | None = None
        self.plain = False
        self._counts = counts
        self._protect: SrtpSender | None = None
        self._unprotect: SrtpReceiver | None = None
        # True if streams may have news: most datagrams are about something else, and each stream is a chain of stages.
        self._unsent = self._untold = self._untimed = False
        self._controls: list[bytes] = []  # of the application, protected
        self._events: list[PeerEvent] = []

    def connected(self, keys: SrtpKeys) -> None:
        self._protect, self._unprotect = SrtpSender(keys), SrtpReceiver(keys)

    def end(self) -> None:
        """Send and hand out nothing more."""
        self._protect = None
        self.plain = False

    # For the application

    def frame_to_send(
        self,
        mid: str,
        payloads: Sequence[bytes],
        media_time: int,
        now: float,
        *,
        marker: bool = True,
        values: Mapping[str, bytes] | None = None,
        captured_at: float | None = None,
    ) -> list[bytes]:
        """Send a frame like `OutgoingStream.send`. Return the datagrams due by that: nothing else to drain; `timer` may
        be earlier. Raises PeerNotReady: it is not up, or this side sends nothing in section `mid`."""
        stream, protect = self.streams.outgoing.get(mid), self._protect
        if stream is None or protect is None:
            raise PeerNotReady(f"nothing can be sent in section {mid!r}")
        stream.send(payloads, media_time, now, marker=marker, values=values, captured_at=captured_at)
        self.due = earliest(self.due, stream.timer())
        sent = list(_protected(protect.protect, stream.packets_to_send(), self._counts))
        if controls := stream.controls_to_send():
            sent += _protected(protect.protect_rtcp, self.streams.compounds(controls), self._counts)
        return sent

    def send_rtcp(self, packet: bytes) -> None:
        """Send a compound packet of the application. Raises PeerNotReady before media are up, SrtpPacketTooLong."""
        if self._protect is None:
            raise PeerNotReady("media are not up")
        self._controls.append(self._protect.protect_rtcp(packet))

    def need_incoming(self, mid: str) -> IncomingStream:
        """Return the stream that is received in section `mid`. Raises PeerNotReady."""
        stream = self.streams.incoming.get(mid)
        if stream is None:
            raise PeerNotReady(f"nothing is received in section {mid!r}")
        return stream

    def request_keyframe(self, mid: str, now: float) -> None:
        """Ask the peer for a keyframe. Raises PeerNotReady like `need_incoming`."""
        self.need_incoming(mid).request_keyframe(now)
        self.stir()

    def stir(self) -> None:
        """Note that streams may have something to send and to tell, and another timer."""
        self._unsent = self._untold = self._untimed = True

    # Input

    def receive_plain(self, data: bytes) -> bool:
        """Take an RTP packet the short way, if `plain`. Return False for any other datagram."""
        if not self.plain or self._unprotect is None or datagram_kind(data) is not DatagramKind.RTP:
            return False
        plain = self._unprotect.unprotect(data)
        if plain is not None:
            self._events.append(PlainRtp(plain))
        return True

    def receive(self, data: bytes, kind: DatagramKind, now: float) -> None:
        """Take a datagram of RTP or RTCP."""
        if self._unprotect is None:
            self._counts["media_early"] += 1
        elif kind is DatagramKind.RTP:
            plain = self._unprotect.unprotect(data)
            if plain is not None and self.plain:
                self._events.append(PlainRtp(plain))
            elif plain is not None:
                self.streams.receive_rtp(plain, now)
                self.stir()
        else:
            plain = self._unprotect.unprotect_rtcp(data)
            if plain is not None and self.plain:
                self._events.append(PlainRtcp(plain))
            elif plain is not None:
                self.streams.receive_rtcp(plain, now)
                self.stir()

    # Output

    def datagrams_to_send(self) -> list[bytes]:
        sent, self._controls = self._controls, []
        if self._protect is None or not self._unsent:
            return sent
        self._unsent = False
        sent += _protected(self._protect.protect_rtcp, self.streams.rtcp_to_send(), self._counts)
        sent += _protected(self._protect.protect, self.streams.rtp_to_send(), self._counts)
        return sent

    def events(self) -> list[PeerEvent]:
        events, self._events = self._events, []
        if self._untold:
            self._untold = False
            events += [PacketReceived(mid, packet) for mid, packet in self.streams.packets()]
            events += [MediaEvent(mid, event) for mid, event in self.streams.events()]
        return events

    # Time and the end

    def timer(self) -> float | None:
        if self._untimed:
            self.due, self._untimed = self.streams.timer(), False
        return self.due

    def close(self, now: float) -> None:
        """Say goodbye to the receivers of its streams."""
        self.streams.close(now)
        self.stir()

    @property
    def dropped(self) -> Counter[str]:
        """Counts of unused input, by reason."""
        dropped = Counter(self.streams.counts)
        if self._unprotect is not None:
            dropped += Counter({f"srtp_{name}": count for name, count in self._unprotect.counts.items()})
        return dropped


def _protected(protect: Callable[[bytes], bytes], packets: Iterable[bytes], counts: Counter[str]) -> Iterator[bytes]:
    for packet in packets:
        try:
            yield protect(packet)
        except SrtpPacketTooLong:  # the application's header extensions have hundreds of bytes
            counts["packet_too_long"] += 1
