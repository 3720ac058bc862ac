"""The four-way handshake (RFC 9260 5): INIT, INIT ACK, COOKIE ECHO and COOKIE ACK."""

from collections import Counter
from struct import Struct

from lockstep.rtc.sctp.data_transfer import DataTransfer
from lockstep.rtc.sctp.errors import ProtocolViolation
from lockstep.rtc.sctp.lifecycle import Lifecycle, State
from lockstep.rtc.sctp.packets import Packets
from lockstep.rtc.sctp.peer_init import Cookies, PeerInit, own_parameters, read_init, unrecognized
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import CookieAck, CookieEcho, Error, Init, InitAck
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER
from lockstep.rtc.sctp.wire.parameters import STALE_COOKIE, STATE_COOKIE

__all__ = ["Handshake"]

MOST_STREAMS = 65535  # announced; RFC 8831 6.2

_word = Struct("!L")


class Handshake:
    """Makes both ends known to each other, from either side, and begins the transfer of data.

    `repeat_at` is the time at which `handle_timer` is due (T1); `cookie_is_due`: call `send_cookie`.
    """

    def __init__(
        self,
        settings: SctpSettings,
        initial_tsn: int,
        cookies: Cookies,
        lifecycle: Lifecycle,
        packets: Packets,
        transfer: DataTransfer,
        round_trip: RoundTrip,
        counts: Counter[str],
    ) -> None:
        self.repeat_at: float | None = None
        self.cookie_is_due = False
        self._settings = settings
        self._initial_tsn = initial_tsn
        self._cookies = cookies
        self._lifecycle = lifecycle
        self._packets = packets
        self._transfer = transfer
        self._round_trip = round_trip
        self._counts = counts
        self._cookie = b""  # from the peer
        self._repeats = 0
        self._asked_at = 0.0  # the time at which the handshake's chunk left

    def start(self, now: float) -> None:
        """Send INIT."""
        self._lifecycle.become(State.COOKIE_WAIT)
        self.cookie_is_due = False
        self._repeats = 0
        self._send_init(now)

    def handle_timer(self, now: float) -> None:
        """Repeat a chunk if T1 has expired (RFC 9260 5.1)."""
        if self.repeat_at is None or now < self.repeat_at:
            return
        self._repeats += 1
        if self._lifecycle.state is State.COOKIE_WAIT:
            self._send_init(now)
        else:
            self.cookie_is_due = True
            self._transfer.sender.handle_timer(now)  # the messages in its packet
            self._repeat_later(now)

    def send_cookie(self, now: float) -> None:
        """Send COOKIE ECHO, and as many messages as fit: nothing else leaves before the answer (RFC 9260 5.1 C)."""
        self.cookie_is_due = False
        echo = CookieEcho(self._cookie).encode()
        room = self._settings.max_packet - COMMON_HEADER - len(echo)
        self._packets.send(echo + self._transfer.sender.chunks(room, now))

    def _send_init(self, now: float) -> None:
        self._packets.send_alone(0, Init(*self._own_init(), own_parameters(self._settings)))
        self._repeat_later(now)

    def _own_init(self) -> tuple[int, int, int, int, int]:
        settings = self._settings
        return self._packets.tag, settings.receive_window, MOST_STREAMS, settings.max_streams, self._initial_tsn

    def _repeat_later(self, now: float) -> None:
        interval = self._settings.initial_timeout * (1 << min(self._repeats, 16))
        self.repeat_at = now + min(interval, self._settings.handshake_ceiling)
        if self._repeats == 0:
            self._asked_at = now

    # Chunks in

    def receive_init(self, chunk: Init, now: float) -> None:
        peer = read_init(chunk)
        if self._lifecycle.is_up and peer.tag != self._packets.peer_tag:
            raise ProtocolViolation("peer_restarted")  # RFC 9260 5.2.2; see `Association`
        if self._lifecycle.state is State.SHUTDOWN_ACK_SENT:
            return
        # 5.1 B; 5.2.1 wants the same tag and TSN again where INITs collide, and so does a repeated INIT.
        cookie = (STATE_COOKIE, self._cookies.seal(peer, now))
        parameters = [cookie, *own_parameters(self._settings), *unrecognized(chunk.parameters)]
        self._packets.send_alone(peer.tag, InitAck(*self._own_init(), parameters))

    def receive_init_ack(self, chunk: InitAck, now: float) -> None:
        if self._lifecycle.state is not State.COOKIE_WAIT:
            self._counts["unexpected"] += 1  # RFC 9260 5.2.3
            return
        peer = read_init(chunk)
        cookie = next((value for kind, value in chunk.parameters if kind == STATE_COOKIE), b"")
        if not cookie:
            raise ProtocolViolation("init_invalid")  # 3.3.3: the one mandatory parameter
        self._answered(now)
        self._know(peer)
        self._cookie = cookie
        self.cookie_is_due = True
        self._lifecycle.become(State.COOKIE_ECHOED)
        self._repeat_later(now)

    def receive_cookie_echo(self, chunk: CookieEcho, now: float) -> None:
        """Take COOKIE ECHO: RFC 9260 5.1 D and the table of 5.2.4, without a restart (A), since INIT ends on that."""
        opened = self._cookies.open(chunk.body)
        if opened is None:
            self._counts["bad_cookie"] += 1
            return
        peer, made = opened
        if self._lifecycle.is_up or self._lifecycle.state is State.SHUTDOWN_ACK_SENT:
            if peer.tag == self._packets.peer_tag and self._lifecycle.state is State.ESTABLISHED:
                self._packets.answer(CookieAck())  # D: the answer was lost
            return
        if self._cookies.is_stale(made, now):
            self._packets.send_alone(peer.tag, Error([(STALE_COOKIE, _word.pack(0))]))
            return
        if peer.tag != self._packets.peer_tag:
            self._know(peer)
        self._packets.control.insert(0, CookieAck().encode())
        self._be_established()

    def receive_cookie_ack(self, chunk: CookieAck, now: float) -> None:
        if self._lifecycle.state is State.COOKIE_ECHOED:
            self._answered(now)
            self._be_established()

    def receive_error(self, chunk: Error, now: float) -> None:
        self._counts["error_from_peer"] += 1
        if self._lifecycle.state is State.COOKIE_ECHOED and any(kind == STALE_COOKIE for kind, _ in chunk.causes):
            self.start(now)  # RFC 9260 5.2.6: begin anew

    def _answered(self, now: float) -> None:
        """Note the answer to the handshake's chunk, which measures a round trip if the chunk was sent once."""
        if self._repeats == 0:
            self._round_trip.sample(now - self._asked_at, now)
        self._repeats = 0

    def _know(self, peer: PeerInit) -> None:
        self._packets.peer_tag = peer.tag
        self._transfer.peer_is(peer)

    def _be_established(self) -> None:
        self._lifecycle.become(State.ESTABLISHED)
        self.repeat_at = None
        self.cookie_is_due = False
        self._transfer.begin()
