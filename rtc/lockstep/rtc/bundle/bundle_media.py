"""The media of one BUNDLE, encrypted: streams of packets behind SRTP, without I/O."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from lockstep.rtc.bundle.settings import PeerNotReady
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.peer_events import MediaEvent, PacketReceived, PeerEvent, PlainRtcp, PlainRtp
from lockstep.rtc.rtp.incoming import IncomingStream
from lockstep.rtc.rtp.outgoing import OutgoingStream
from lockstep.rtc.rtp.stage import earliest
from lockstep.rtc.rtp.streams import Streams
from lockstep.rtc.srtp import SrtpKeys, SrtpPacketTooLong, SrtpReceiver, SrtpSender

__all__ = ["BundleMedia"]


class BundleMedia:
    """Set `streams` when they are negotiated, then call `connected`. After each call, drain `datagrams_to_send` and
    `events`, and ask for `timer`.

    `streams`: None until both descriptions are known. `due`: the timer as far as it is known without asking the
    streams.
    """

    def __init__(self, counts: Counter[str]) -> None:
        """`counts`: those of the peer."""
        self.streams: Streams | None = None
        self.due: float | None = None
        self._counts = counts
        self._protect: SrtpSender | None = None
        self._unprotect: SrtpReceiver | None = None
        self._plain = False  # packets are handed out decrypted and unread
        # True if streams may have news: most datagrams are about something else, and each stream is a chain of stages.
        self._unsent = self._untold = self._untimed = False
        self._events: list[PeerEvent] = []

    def connected(self, keys: SrtpKeys) -> None:
        self._protect, self._unprotect = SrtpSender(keys), SrtpReceiver(keys)

    def outgoing(self, mid: str) -> OutgoingStream | None:
        """Return the stream that this side sends in section `mid`; None: it sends nothing there, or not yet."""
        return None if self.streams is None or self._protect is None else self.streams.outgoing.get(mid)

    def need_incoming(self, mid: str) -> IncomingStream:
        """Return the stream that is received in section `mid`. Raises PeerNotReady."""
        stream = self.streams.incoming.get(mid) if self.streams is not None else None
        if stream is None:
            raise PeerNotReady(f"nothing is received in section {mid!r}")
        return stream

    def stir(self) -> None:
        """Note that streams may have something to send and to tell, and another timer."""
        self._unsent = self._untold = self._untimed = True

    # Input

    def take_plain(self) -> None:
        """Hand out packets decrypted and unread from now on."""
        self._plain = True

    def receive_plain(self, data: bytes) -> bool:
        """Take an RTP packet the short way, after `take_plain`. Return False for any other datagram."""
        if not self._plain or self._unprotect is None or datagram_kind(data) is not DatagramKind.RTP:
            return False
        plain = self._unprotect.unprotect(data)
        if plain is not None:
            self._events.append(PlainRtp(plain))
        return True

    def receive(self, data: bytes, kind: DatagramKind, now: float) -> None:
        """Take a datagram of RTP or RTCP."""
        if self._unprotect is None or self.streams is None:
            self._counts["media_early"] += 1
        elif kind is DatagramKind.RTP:
            plain = self._unprotect.unprotect(data)
            if plain is not None and self._plain:
                self._events.append(PlainRtp(plain))
            elif plain is not None:
                self.streams.receive_rtp(plain, now)
                self.stir()
        else:
            plain = self._unprotect.unprotect_rtcp(data)
            if plain is not None and self._plain:
                self._events.append(PlainRtcp(plain))
            elif plain is not None:
                self.streams.receive_rtcp(plain, now)
                self.stir()

    # Output

    def datagrams_of(self, stream: OutgoingStream) -> list[bytes]:
        """Return what is due of one stream, after a frame was sent on it: nothing else has to be drained."""
        self.due = earliest(self.due, stream.timer())
        if self._protect is None or self.streams is None:
            return []
        sent = list(_protected(self._protect.protect, stream.packets_to_send(), self._counts))
        if controls := stream.controls_to_send():
            sent += _protected(self._protect.protect_rtcp, self.streams.compounds(controls), self._counts)
        return sent

    def protected_rtcp(self, packet: bytes) -> bytes:
        """Return a compound packet of the application, encrypted. Raises PeerNotReady and SrtpPacketTooLong."""
        if self._protect is None:
            raise PeerNotReady("media are not up")
        return self._protect.protect_rtcp(packet)

    def datagrams_to_send(self) -> list[bytes]:
        if self.streams is None or self._protect is None or not self._unsent:
            return []
        self._unsent = False
        sent = list(_protected(self._protect.protect_rtcp, self.streams.rtcp_to_send(), self._counts))
        sent += _protected(self._protect.protect, self.streams.rtp_to_send(), self._counts)
        return sent

    def events(self) -> list[PeerEvent]:
        events, self._events = self._events, []
        if self.streams is not None and self._untold:
            self._untold = False
            events += [PacketReceived(mid, packet) for mid, packet in self.streams.packets()]
            events += [MediaEvent(mid, event) for mid, event in self.streams.events()]
        return events

    # Time and the end

    def timer(self) -> float | None:
        if self._untimed and self.streams is not None:
            self.due, self._untimed = self.streams.timer(), False
        return self.due

    def close(self, now: float) -> None:
        """Say goodbye to the receivers of its streams."""
        if self.streams is not None:
            self.streams.close(now)
            self.stir()

    @property
    def dropped(self) -> Counter[str]:
        """Counts of unused input, by reason."""
        dropped: Counter[str] = Counter()
        if self.streams is not None:
            dropped += self.streams.counts
        if self._unprotect is not None:
            dropped += Counter({f"srtp_{name}": count for name, count in self._unprotect.counts.items()})
        return dropped


def _protected(protect: Callable[[bytes], bytes], packets: Iterable[bytes], counts: Counter[str]) -> Iterator[bytes]:
    for packet in packets:
        try:
            yield protect(packet)
        except SrtpPacketTooLong:  # the application's header extensions have hundreds of bytes
            counts["packet_too_long"] += 1
