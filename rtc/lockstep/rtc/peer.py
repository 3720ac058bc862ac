"""One WebRTC peer without I/O: ICE, DTLS, SRTP, SCTP with its channels, and RTP, put together for one BUNDLE.

    way in:   receive_datagram → (lockstep.rtc.demux) → ICE | DTLS → SCTP → channels | SRTP → streams → events
    way out:  send, send_frame → channels → SCTP → DTLS | streams → SRTP → datagrams_to_send, on the path of ICE

Negotiate with `answer`, or with `offer` and then `accept`; then live as every core: `receive_datagram`, `handle_timer`;
drain `datagrams_to_send` and `events` after each; `timer`.
"""

from collections import Counter, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from random import Random, SystemRandom

from OpenSSL import SSL

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.bundle.bundle_media import BundleMedia
from lockstep.rtc.bundle.local_side import LocalSide
from lockstep.rtc.bundle.settings import OfferedMedia, PeerNotReady, PeerSettings
from lockstep.rtc.channels import ChannelMessage, DataChannels
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.dtls import DtlsClosed, DtlsConnected, DtlsConnection, DtlsData, DtlsFailed, DtlsState
from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import CandidateError, parse_candidate
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.directory import Directory
from lockstep.rtc.ice.events import Answered, Ended, PathChanged, Restarted, RestartFailed
from lockstep.rtc.peer_events import (
    Connected,
    PathFound,
    PeerEnded,
    PeerEvent,
)
from lockstep.rtc.rtp.outgoing import OutgoingStream, PathShare
from lockstep.rtc.rtp.stage import earliest
from lockstep.rtc.rtp.streams import Streams
from lockstep.rtc.sdp import (
    Fragment,
    FragmentCandidate,
    LocalMedia,
    MediaSection,
    SdpError,
    SessionDescription,
    Transport,
    check_answer,
    reverse,
)

__all__ = ["OfferedMedia", "Peer", "PeerNotReady", "PeerSettings"]


class Peer:
    """One session with one peer. It ends with PeerEnded; make another object for another session."""

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
        self._context = context
        self._local = LocalSide(self.ice, fingerprint, self.settings, self._random)
        self._media = BundleMedia(self.counts)
        self._offer: SessionDescription | None = None  # the offer of this side, until it is answered
        self._dtls: DtlsConnection | None = None  # None until both descriptions are known
        self._held: deque[bytes] = deque(maxlen=self.settings.held)
        self.channels: DataChannels | None = None  # None when there are none
        self._tagged: MediaSection | None = None  # section with the transport of the bundle; None until negotiated
        self._out: list[Datagram] = []
        self._events: list[PeerEvent] = []
        self._now = 0.0
        self._ended = False

    @property
    def streams(self) -> Streams | None:
        """The streams of its media; None until both descriptions are known."""
        return self._media.streams

    # Negotiation

    def answer(self, offer: SessionDescription, media: Mapping[str, LocalMedia], now: float) -> SessionDescription:
        """Return the answer to a peer's offer. `media`: the abilities of this side, by the offer's mid.

        Raises:
            SdpError: the offer cannot be answered; nothing has changed.
            RuntimeError: this session was negotiated before.
        """
        self._check_new()
        answer = self._local.answer(offer, media)
        self._negotiated(offer, answer, answer.sections, now)
        return answer

    def offer(self, media: Sequence[OfferedMedia], *, data: bool = True) -> SessionDescription:
        """Return an offer, with channels if `data`. The answer goes to `accept`. Raises RuntimeError like `answer`."""
        self._check_new()
        self._offer = self._local.offer(media, data=data)
        return self._offer

    def accept(self, answer: SessionDescription, now: float) -> None:
        """Take the peer's answer to the offer. Raises SdpError; RuntimeError without an offer that waits for one."""
        if self._offer is None:
            raise RuntimeError("no offer waits for an answer")
        check_answer(self._offer, answer)
        ours = [replace(section, direction=reverse(section.direction)) for section in answer.sections]
        self._offer = None
        self._negotiated(answer, answer, ours, now)

    def add_candidate(self, line: str) -> None:
        """Add a remote candidate, "candidate:…" (RFC 8838). An unknown candidate is counted and ignored."""
        try:
            self.ice.add_remote_candidate(parse_candidate(line))
        except CandidateError:
            self.counts["candidate_malformed"] += 1

    # A restart of ICE: DTLS and SRTP stay, the path changes (RFC 8445 9, RFC 8842 5.1)

    @property
    def tagged(self) -> MediaSection:
        """The section that candidates are for (RFC 9143 7.2.1). Raises PeerNotReady before both descriptions."""
        if self._tagged is None:
            raise PeerNotReady("not negotiated yet")
        return self._tagged

    def restart(self, now: float, candidates: Iterable[LocalCandidate] | None = None) -> Fragment:
        """Look for another path. Return the fragment for the peer, whose answer goes to `accept_restart`.

        `Restarted` or `RestartFailed` follows. Until then the path is the one before, for as long as the peer consents.
        `candidates`: the addresses for the peer now; None: those of before. Raises PeerNotReady.
        """
        mid = self._check_alive().mid
        credentials = self.ice.restart(now, candidates)
        self._now = now
        lines = (local.candidate.line() for local in self.ice.local_candidates)
        found = tuple(FragmentCandidate(mid, line) for line in lines)
        return Fragment(credentials.ufrag, credentials.password, found, end_of_candidates=True)

    def accept_restart(self, fragment: Fragment, now: float) -> None:
        """Take the peer's answer to the fragment of `restart`.

        Raises:
            SdpError: it has no credentials; the restart waits for a better one.
            RuntimeError: no restart waits for it.
        """
        if not fragment.ufrag or not fragment.password:
            raise SdpError("no ice-ufrag or no ice-pwd")
        self._now = now
        self.ice.set_remote(Credentials(fragment.ufrag, fragment.password), (), now)
        for candidate in fragment.candidates:
            self.add_candidate(candidate.line)
        self._settle(now)

    def answer_restart(
        self, fragment: Fragment, now: float, candidates: Iterable[LocalCandidate] | None = None
    ) -> Fragment:
        """Return the answer to the fragment of a restart that the peer has begun. Raises SdpError and PeerNotReady."""
        if not fragment.ufrag or not fragment.password:
            raise SdpError("no ice-ufrag or no ice-pwd")
        answer = self.restart(now, candidates)
        self.accept_restart(fragment, now)
        return answer

    def cancel_restart(self) -> None:
        """Give up a restart: the path before it stays. No effect without a restart."""
        self.ice.cancel_restart()

    @property
    def is_up(self) -> bool:
        """True if DTLS is connected and the session has not ended; a path may be missing during a restart."""
        return not self._ended and self._dtls is not None and self._dtls.state is DtlsState.CONNECTED

    def _check_alive(self) -> MediaSection:
        if self._ended:
            raise PeerNotReady("the session has ended")
        return self.tagged

    def _check_new(self) -> None:
        if self._dtls is not None:
            raise RuntimeError("this session is negotiated; another one is another peer")

    def _negotiated(
        self, remote: SessionDescription, answer: SessionDescription, ours: Sequence[MediaSection], now: float
    ) -> None:
        """Take the result of a negotiation. `ours`: the answer's sections with the direction of this side."""
        self._now = now
        self._tagged = next(iter(answer.accepted), None)
        media = self._local.negotiated(remote, answer, ours)
        self._media.streams = Streams(media, self._local.identity, PathShare(self.settings.epoch), self._random)
        we_answer = remote is not answer
        active = (answer.transport.setup == "active") is we_answer
        self._dtls = DtlsConnection(
            self._context, "client" if active else "server", remote.transport.fingerprints, self.settings.dtls
        )
        data = next((each for each in answer.accepted if each.sctp_port is not None), None)
        theirs = remote.section(data.mid) if data is not None else None
        if theirs is not None:
            self.channels = DataChannels(
                self.settings.sctp,
                self._random.randbytes,
                client=active,
                peer_port=theirs.sctp_port,
                peer_max_message=theirs.max_message_size,
            )
        self._begin_ice(remote.transport, now)

    def _begin_ice(self, remote: Transport, now: float) -> None:
        self.ice.set_remote(Credentials(remote.ufrag, remote.password), (), now)
        for line in remote.candidates:
            self.add_candidate(line)
        if self.ice.path is not None:
            self._start_dtls(now)

    # Media without stages

    def take_plain_packets(self) -> None:
        """Hand out packets decrypted and unread, as PlainRtp and PlainRtcp, for a receiver that only counts. Then this
        package sends no reports on them, and no requests for missing ones.
        """
        self._media.take_plain()

    def receive_plain(self, data: bytes) -> bool:
        """Take a media datagram the short way, after `take_plain_packets`; drain `settled_events`.

        It came on a path of this peer. Return False for another datagram, which is for `receive_datagram`. This makes
        no timer and nothing to send.
        """
        if self._ended or not self._media.receive_plain(data):
            return False
        self._events += self._media.events()
        return True

    def send_rtcp(self, packet: bytes) -> None:
        """Send a compound packet of the application. Raises PeerNotReady before media are up, SrtpPacketTooLong."""
        if self._ended:
            raise PeerNotReady("media are not up")
        path = self.ice.path
        protected = self._media.protected_rtcp(packet)
        if path is not None:
            self._out.append(Datagram(protected, path))

    def note_round_trip(self, seconds: float) -> None:
        """Take a round trip, in s, that the application has measured; lost packets are asked for accordingly."""
        if self.streams is not None:
            self.streams.share.round_trip.measure(seconds)

    # Sending

    def open_channel(
        self, label: str, now: float, *, protocol: str = "", reliability: Reliability | None = None
    ) -> int:
        """Like `DataChannels.open`. Raises PeerNotReady as well."""
        self._now = now
        return self._need_channels().open(label, now, protocol=protocol, reliability=reliability)

    def send(self, channel: int, data: str | bytes, now: float) -> None:
        """Like `DataChannels.send`. Raises PeerNotReady as well."""
        self._now = now
        self._need_channels().send(channel, data, now)

    def open_negotiated_channel(
        self, channel: int, label: str, *, protocol: str = "", reliability: Reliability | None = None
    ) -> None:
        """Like `DataChannels.open_negotiated`. Raises PeerNotReady as well."""
        self._need_channels().open_negotiated(channel, label, protocol=protocol, reliability=reliability)

    def has_waiting(self, channel: int) -> bool:
        """Like `Association.has_waiting`; False without channels."""
        return self.channels is not None and self.channels.association.has_waiting(channel)

    def tell_when_empty(self, channel: int) -> None:
        """Like `DataChannels.tell_when_empty`; no effect without channels."""
        if self.channels is not None:
            self.channels.tell_when_empty(channel)

    def close_channel(self, channel: int, now: float) -> None:
        self._now = now
        self._need_channels().close(channel, now)

    def send_frame(
        self,
        mid: str,
        payloads: Sequence[bytes],
        media_time: int,
        now: float,
        *,
        marker: bool = True,
        values: Mapping[str, bytes] | None = None,
        captured_at: float | None = None,
    ) -> None:
        """Like `OutgoingStream.send`. Raises PeerNotReady: it is not up, or this side sends nothing in section
        `mid`."""
        self._now = now
        self._need_outgoing(mid).send(payloads, media_time, now, marker=marker, values=values, captured_at=captured_at)
        self._media.stir()

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
    ) -> list[Datagram]:
        """Like `send_frame`, and return the datagrams due by that: nothing else to drain. `timer` may be earlier."""
        stream = self._need_outgoing(mid)
        self._now = now
        stream.send(payloads, media_time, now, marker=marker, values=values, captured_at=captured_at)
        sent, path = self._media.datagrams_of(stream), self.ice.path
        return [] if path is None else [Datagram(data, path) for data in sent]

    @property
    def media_timer(self) -> float | None:
        """The time at which `handle_timer` is due for the sake of outgoing media."""
        return None if self._ended else self._media.due

    @property
    def channel_timer(self) -> float | None:
        """The time at which `handle_timer` is due for the sake of data channels."""
        return None if self._ended or self.channels is None else self.channels.timer()

    def _need_outgoing(self, mid: str) -> OutgoingStream:
        stream = self._media.outgoing(mid)
        if stream is None or self._ended:
            raise PeerNotReady(f"nothing can be sent in section {mid!r}")
        return stream

    def holds_back(self, mid: str) -> bool:
        """True if packets of the outgoing stream in section `mid` wait for its pacer. `PacketsLeft` follows."""
        stream = self.streams.outgoing.get(mid) if self.streams is not None else None
        return stream is not None and stream.pacer is not None and stream.pacer.holds

    def pace(self, bitrate: float | None) -> None:
        """Spread pictures over a path that is believed to carry `bitrate` (bit/s). None: no limit was seen."""
        if self.streams is not None:
            self.streams.share.path_budget.limit(bitrate)

    def report_every(self, seconds: float) -> None:
        """Send sender reports every `seconds` (RFC 3550 6.2), from the report after the next on."""
        if self.streams is not None:
            for stream in self.streams.outgoing.values():
                stream.reports.interval = seconds

    def request_keyframe(self, mid: str, now: float) -> None:
        """Ask the peer for a keyframe. Raises PeerNotReady: this side does not receive in section `mid`."""
        self._now = now
        self._media.need_incoming(mid).request_keyframe(now)
        self._media.stir()

    def limit(self, mid: str, bitrate: int) -> None:
        """Ask the peer to send at most `bitrate` bit/s in this section (REMB). Raises PeerNotReady like
        `request_keyframe`."""
        self._media.need_incoming(mid).limit = bitrate

    @property
    def dropped(self) -> Counter[str]:
        """Counts of unused input, by reason; without the input that ICE passes over as a matter of course."""
        dropped = self.counts - Counter(dtls_early=self.counts["dtls_early"])  # those were kept
        return dropped + self._media.dropped

    def close(self, now: float) -> None:
        """Say goodbye in every protocol that has a message for it. Idempotent; drain `datagrams_to_send` once more."""
        if self._ended:
            return
        self._now = now
        self._media.close(now)
        if self.channels is not None:
            self.channels.abort(now)
        self._collect()
        if self._dtls is not None:
            self._dtls.close(now)
        self._collect()
        self._end("closed")

    def _need_channels(self) -> DataChannels:
        if self.channels is None or self._ended:
            raise PeerNotReady("there are no data channels")
        return self.channels

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
            self._receive_dtls(data, now)
        elif kind in (DatagramKind.RTP, DatagramKind.RTCP):
            self._media.receive(data, kind, now)
        else:
            self.counts["unknown_protocol"] += 1
        self._settle(now)

    def handle_timer(self, now: float) -> None:
        self._now = now
        if self._ended:
            return
        self.ice.handle_timer(now)
        for core in (self._dtls, self.channels, self.streams):
            due = core.timer() if core is not None else None
            if core is not None and due is not None and now >= due:
                core.handle_timer(now)
        self._media.stir()
        self._settle(now)

    def timer(self) -> float | None:
        if self._ended:
            return None
        cores = (self.ice, self._dtls, self.channels)
        return earliest(self._media.timer(), *(core.timer() for core in cores if core is not None))

    def datagrams_to_send(self) -> list[Datagram]:
        self._collect()
        out, self._out = self._out, []
        return out

    @property
    def has_events(self) -> bool:
        """True if sending has made events: `events` has more."""
        return bool(
            self._events
            or (self.channels is not None and self.channels.has_events)
            or (self._dtls is not None and self._dtls.has_events)
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
        if self._dtls is not None:
            self._dtls.read_on(self._now)

    def settled_events(self) -> list[PeerEvent]:
        """Like `events`, for less, if `receive_datagram`, `receive_plain` or `handle_timer` was called last: those
        leave no core with an event that another one must know. After `receive_datagram`, `read_on` comes next."""
        events, self._events = self._events, []
        return events

    # Input

    def _receive_dtls(self, data: bytes, now: float) -> None:
        if self._dtls is None or self._dtls.state is DtlsState.NEW:
            self._held.append(data)  # the peer's answer, or the path that ICE has found, is on its way
            self.counts["dtls_early"] += 1
        else:
            self._dtls.receive_first(data, now)

    def _settle(self, now: float) -> None:
        """Pass the cores' events to one another, and to the application."""
        for event in self.ice.events():
            if isinstance(event, PathChanged):
                self._events.append(PathFound(event.path))
                self._start_dtls(now)
            elif isinstance(event, Answered | Restarted | RestartFailed):
                self._events.append(event)
            elif isinstance(event, Ended):
                self._end(event.reason)
        if self._dtls is not None:
            self._settle_dtls(self._dtls, now)
        self._tell()

    def _tell(self) -> None:
        """Hand out the events of channels and streams; nothing after the end."""
        if self._ended:
            return
        if self.channels is not None:
            self._events += self.channels.events()
        self._events += self._media.events()

    def _start_dtls(self, now: float) -> None:
        if self._dtls is not None and self._dtls.state is DtlsState.NEW and self.ice.path is not None:
            self._dtls.start(now)
            while self._held:
                self._dtls.receive_datagram(self._held.popleft(), now)

    def _settle_dtls(self, dtls: DtlsConnection, now: float) -> None:
        for event in dtls.events():
            if isinstance(event, DtlsConnected):
                self._connected(event, now)
            elif isinstance(event, DtlsData):
                if self.channels is None:
                    self.counts["data_without_channels"] += 1
                else:
                    self.channels.receive_packet(event.data, now)
            elif isinstance(event, DtlsClosed):
                self._end("peer_closed")
            elif isinstance(event, DtlsFailed):
                self._end(f"dtls_{event.reason}", event.detail)

    def _connected(self, event: DtlsConnected, now: float) -> None:
        if event.srtp is not None:
            self._media.connected(event.srtp)
        self._events.append(Connected(event.srtp.profile.name if event.srtp is not None else None))
        if self.channels is not None:
            self.channels.association.start(now)

    def _end(self, reason: str, detail: str = "") -> None:
        if self._ended:
            return
        self._collect()  # an alert or a close_notify may still go out
        self._tell()
        self._ended = True
        self.ice.close()
        self._events.append(PeerEnded(reason, detail))

    # Output

    def _collect(self) -> None:
        """Take the due data from each core, the innermost first."""
        if self._ended:
            return
        self._out += self.ice.datagrams_to_send()
        dtls, path = self._dtls, self.ice.path
        if dtls is None:
            return
        if self.channels is not None and dtls.state is DtlsState.CONNECTED:
            for packet in self.channels.packets_to_send():
                if dtls.state is DtlsState.CONNECTED:  # any of them may end it
                    dtls.send(packet, self._now)
        sent = dtls.datagrams_to_send()
        sent += self._media.datagrams_to_send()
        if path is not None:  # without a path every packet is as good as lost, and repeated as such
            self._out += [Datagram(data, path) for data in sent]
