"""One WebRTC peer without I/O: ICE, DTLS, SRTP, SCTP with its channels, and RTP, put together for one BUNDLE.

    way in:   receive_datagram → (lockstep.rtc.demux) → ICE | DTLS → SCTP → channels | SRTP → streams → events
    way out:  channels → SCTP → DTLS | streams → SRTP → datagrams_to_send, on the path of ICE

Negotiate with `answer`, or with `negotiation.offer` and then `accept`; then live as every core: `receive_datagram`,
`handle_timer`; drain `datagrams_to_send` and `events` after each; `timer`.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from random import Random, SystemRandom

from OpenSSL import SSL

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.bundle.bundle_media import BundleMedia
from lockstep.rtc.bundle.dtls_transport import DtlsTransport
from lockstep.rtc.bundle.local_side import LocalSide
from lockstep.rtc.bundle.negotiation import Agreement, Negotiation
from lockstep.rtc.bundle.settings import OfferedMedia, PeerNotReady, PeerSettings
from lockstep.rtc.channels import ChannelMessage, DataChannels
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.dtls import DtlsClosed, DtlsConnected, DtlsData, DtlsState
from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.directory import Directory
from lockstep.rtc.ice.events import Ended, PathChanged
from lockstep.rtc.peer_events import Connected, PathFound, PeerEnded, PeerEvent
from lockstep.rtc.rtp.outgoing import PathShare
from lockstep.rtc.rtp.stage import earliest
from lockstep.rtc.rtp.streams import Streams
from lockstep.rtc.sdp import LocalMedia, SessionDescription

__all__ = ["OfferedMedia", "Peer", "PeerNotReady", "PeerSettings"]


class Peer:
    """One session with one peer. It ends with PeerEnded; make another object for another session.

    Its parts are for the application as well: `negotiation` for candidates and restarts, `media` for frames, `share`
    for a round trip or a limit of the path that the application knows, and `need_channels` for data channels. After a
    call of a part, drain as after a call of this object.
    """

    def __init__(
        self,
        context: SSL.Context,
        fingerprint: Fingerprint,
        candidates: Iterable[LocalCandidate],
        *,
        controlling: bool,
        settings: PeerSettings | None = None,
        directory: Directory | None = None,
        random: Random | None = None,
    ) -> None:
        """Begin with nothing negotiated.

        Args:
            context: from `lockstep.rtc.dtls.dtls_context`.
            fingerprint: that of the context's certificate.
            candidates: the addresses for the peer.
            controlling: True if this side decides on the path: the offerer does, and a side that answers a lite agent
                (RFC 8445 6.1.1).
            directory: that of the `ice.port.Port` whose sockets this peer shares.
            random: must be unpredictable: a SystemRandom except in tests.
        """
        self.settings = settings or PeerSettings()
        self.counts: Counter[str] = Counter()
        self._random = random or SystemRandom()
        self.ice = Agent(
            candidates, controlling=controlling, settings=self.settings.ice, directory=directory, rng=self._random
        )
        local = LocalSide(self.ice, fingerprint, self.settings, self._random)
        self._identity = local.identity
        self.negotiation = Negotiation(self.ice, local, self.counts)
        self.share = PathShare(self.settings.epoch)
        self.media = BundleMedia(Streams((), local.identity, self.share, self._random), self.counts)
        self._dtls = DtlsTransport(context, self.ice, self.settings.dtls, self.settings.held, self.counts)
        self.channels: DataChannels | None = None  # None when there are none
        self._out: list[Datagram] = []
        self._events: list[PeerEvent] = []
        self._now = 0.0
        self._ended = False

    # Negotiation

    def answer(self, offer: SessionDescription, media: Mapping[str, LocalMedia], now: float) -> SessionDescription:
        """Return the answer to a peer's offer. `media`: the abilities of this side, by the offer's mid.

        Raises:
            SdpError: the offer cannot be answered; nothing has changed.
            RuntimeError: this session was negotiated before.
        """
        answer, agreement = self.negotiation.agree_on(offer, media)
        self._begin(agreement, now)
        return answer

    def accept(self, answer: SessionDescription, now: float) -> None:
        """Take the peer's answer to the offer. Raises SdpError; RuntimeError without an offer that waits for one."""
        self._begin(self.negotiation.agree_with(answer), now)

    def _begin(self, agreement: Agreement, now: float) -> None:
        self._now = now
        self.media.streams = Streams(agreement.media, self._identity, self.share, self._random)
        self._dtls.negotiated(agreement.role, agreement.remote.fingerprints)
        if (theirs := agreement.channels) is not None:
            self.channels = DataChannels(
                self.settings.sctp,
                self._random.randbytes,
                client=agreement.role == "client",
                peer_port=theirs.sctp_port,
                peer_max_message=theirs.max_message_size,
            )
        self.negotiation.begin_ice(agreement.remote, now)
        self._dtls.start(now)

    @property
    def is_up(self) -> bool:
        """True if DTLS is connected and the session has not ended; a path may be missing during a restart."""
        return not self._ended and self._dtls.is_up

    def need_channels(self, now: float) -> DataChannels:
        """Return the data channels, for a call at `now`. Raises PeerNotReady: there are none, or the session has
        ended."""
        self._now = now
        if self.channels is None or self._ended:
            raise PeerNotReady("there are no data channels")
        return self.channels

    def receive_plain(self, data: bytes) -> bool:
        """Take a media datagram the short way, if `media.plain`; drain `settled_events`.

        It came on a path of this peer. Return False for another datagram, which is for `receive_datagram`. This makes
        no timer and nothing to send.
        """
        if not self.media.receive_plain(data):
            return False
        self._events += self.media.events()
        return True

    @property
    def dropped(self) -> Counter[str]:
        """Counts of unused input, by reason; without the input that ICE passes over as a matter of course."""
        dropped = self.counts - Counter(dtls_early=self.counts["dtls_early"])  # those were kept
        return dropped + self.media.dropped

    def close(self, now: float) -> None:
        """Say goodbye in every protocol that has a message for it. Idempotent; drain `datagrams_to_send` once more."""
        if self._ended:
            return
        self._now = now
        self.media.close(now)
        if self.channels is not None:
            self.channels.abort(now)
        self._collect()
        if self._dtls.connection is not None:
            self._dtls.connection.close(now)
        self._collect()
        self._end("closed")

    # The interface of every core

    def receive_datagram(self, data: bytes, path: Path, now: float) -> None:
        """Take a datagram of any kind from the peer, as far as `ice.port.Port` can say."""
        self._now = now
        if self._ended:
            self.counts["ended"] += 1
            return
        kind = datagram_kind(data)
        if kind is DatagramKind.STUN:
            self.ice.receive_datagram(data, path, now)
        elif not self.ice.accepts(path):
            self.counts["unknown_path"] += 1
        elif kind is DatagramKind.DTLS:
            self._dtls.receive(data, now)
        elif kind in (DatagramKind.RTP, DatagramKind.RTCP):
            self.media.receive(data, kind, now)
        else:
            self.counts["unknown_protocol"] += 1
        self._settle(now)

    def handle_timer(self, now: float) -> None:
        self._now = now
        if self._ended:
            return
        self.ice.handle_timer(now)
        for core in (self._dtls.connection, self.channels, self.media.streams):
            due = core.timer() if core is not None else None
            if core is not None and due is not None and now >= due:
                core.handle_timer(now)
        self.media.stir()
        self._settle(now)

    def timer(self) -> float | None:
        if self._ended:
            return None
        cores = (self.ice, self._dtls.connection, self.channels)
        return earliest(self.media.timer(), *(core.timer() for core in cores if core is not None))

    def datagrams_to_send(self) -> list[Datagram]:
        self._collect()
        out, self._out = self._out, []
        return out

    @property
    def has_events(self) -> bool:
        """True if sending has made events: `events` has more."""
        channels, dtls = self.channels, self._dtls.connection
        return bool(
            self._events or (channels is not None and channels.has_events) or (dtls is not None and dtls.has_events)
        )

    @property
    def has_message(self) -> bool:
        """True if the newest event that waits is a message of a channel."""
        return bool(self._events) and isinstance(self._events[-1], ChannelMessage)

    def events(self) -> list[PeerEvent]:
        self.read_on()
        self._settle(self._now)
        return self.settled_events()

    def read_on(self) -> None:
        """Read what `receive_datagram` has left of a datagram of DTLS; `has_events` tells if there was anything."""
        if self._dtls.connection is not None:
            self._dtls.connection.read_on(self._now)

    def settled_events(self) -> list[PeerEvent]:
        """Like `events`, for less, if `receive_datagram`, `receive_plain` or `handle_timer` was called last: those
        leave no core with an event that another one must know. After `receive_datagram`, `read_on` comes next."""
        events, self._events = self._events, []
        return events

    # Between the cores

    def _settle(self, now: float) -> None:
        """Pass the cores' events to one another, and to the application."""
        for event in self.ice.events():
            if isinstance(event, PathChanged):
                self._events.append(PathFound(event.path))
                self._dtls.start(now)
            elif isinstance(event, Ended):
                self._end(event.reason)
            else:
                self._events.append(event)
        if self._dtls.connection is not None:
            for of_dtls in self._dtls.connection.events():
                if isinstance(of_dtls, DtlsConnected):
                    self._connected(of_dtls, now)
                elif isinstance(of_dtls, DtlsData):
                    if self.channels is None:
                        self.counts["data_without_channels"] += 1
                    else:
                        self.channels.receive_packet(of_dtls.data, now)
                elif isinstance(of_dtls, DtlsClosed):
                    self._end("peer_closed")
                else:
                    self._end(f"dtls_{of_dtls.reason}", of_dtls.detail)
        self._tell()

    def _connected(self, event: DtlsConnected, now: float) -> None:
        if event.srtp is not None:
            self.media.connected(event.srtp)
        self._events.append(Connected(event.srtp.profile.name if event.srtp is not None else None))
        if self.channels is not None:
            self.channels.association.start(now)

    def _tell(self) -> None:
        """Hand out the events of channels and streams; nothing after the end."""
        if self._ended:
            return
        if self.channels is not None:
            self._events += self.channels.events()
        self._events += self.media.events()

    def _end(self, reason: str, detail: str = "") -> None:
        if self._ended:
            return
        self._collect()  # an alert or a close_notify may still go out
        self._tell()
        self._ended = True
        self.media.end()
        self.ice.close()
        self._events.append(PeerEnded(reason, detail))

    def _collect(self) -> None:
        """Take the due data from each core, the innermost first."""
        if self._ended:
            return
        self._out += self.ice.datagrams_to_send()
        dtls, path = self._dtls.connection, self.ice.path
        if dtls is None:
            return
        if self.channels is not None and dtls.state is DtlsState.CONNECTED:
            for packet in self.channels.packets_to_send():
                if dtls.state is DtlsState.CONNECTED:  # any of them may end it
                    dtls.send(packet, self._now)
        sent = dtls.datagrams_to_send()
        sent += self.media.datagrams_to_send()
        if path is not None:  # without a path every packet is as good as lost, and repeated as such
            self._out += [Datagram(data, path) for data in sent]
