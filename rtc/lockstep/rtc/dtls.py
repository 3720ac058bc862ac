"""DTLS 1.2 (RFC 6347) for one peer, by pyOpenSSL on memory instead of a socket.

    dtls = DtlsConnection(dtls_context(certificate), "client", fingerprints)
    dtls.start(now)
    ... then as every core: `receive_datagram`, `handle_timer`; drain `datagrams_to_send` and `events`; `timer`

OpenSSL keeps its own clock for its retransmissions and cannot be given another. This is therefore the one
core here that is not wholly handed the time: `timer()` translates what OpenSSL reports, and `handle_timer` lets it look
at its own clock. Called too early, it does nothing and asks again.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import Literal

from OpenSSL import SSL

from lockstep.rtc.certificate import Certificate
from lockstep.rtc.fingerprint import Fingerprint, is_expected
from lockstep.rtc.srtp import SrtpKeys, available_profiles

__all__ = [
    "DtlsClosed",
    "DtlsConnected",
    "DtlsConnection",
    "DtlsData",
    "DtlsEvent",
    "DtlsFailed",
    "DtlsFailure",
    "DtlsMessageTooLong",
    "DtlsNotConnected",
    "DtlsRole",
    "DtlsSettings",
    "DtlsState",
    "dtls_context",
    "records",
]

DtlsRole = Literal["client", "server"]
DtlsFailure = Literal["protocol", "fingerprint", "timeout", "too_much_handshake"]

DTLS_1_2 = 0xFEFD  # RFC 6347 4.1; RFC 8827 6.5 asks for at least this
# Every peer has ECDSA (RFC 8827 6.5). The certificate of GStreamer is RSA, which its clients need as well.
# CBC is for peers that have no AEAD.
CIPHERS = b":".join(
    b"ECDHE-%s-%s" % (kind, cipher)
    for cipher in (b"AES128-GCM-SHA256", b"CHACHA20-POLY1305", b"AES256-GCM-SHA384", b"AES128-SHA", b"AES256-SHA")
    for kind in (b"ECDSA", b"RSA")
)
SRTP_LABEL = b"EXTRACTOR-dtls_srtp"  # RFC 5764 4.2
FIRST_BYTES = range(20, 64)  # RFC 7983 7
HEADER = 13  # bytes of a record's header (RFC 6347 4.1)
MAX_PLAINTEXT = 1 << 14  # bytes of one record (RFC 6347 4.1.1 and RFC 5246 6.2.1)
APPLICATION_DATA = 23
# pyOpenSSL clears a buffer of the size that it is asked for, which takes the processor's caches: large ones cost more
# than reading twice.
WRITTEN_AT_ONCE = 1 << 11  # bytes that OpenSSL wrote; a flight of a handshake is read in pieces
READ_AT_LEAST = 1 << 11  # bytes of room for a record
MOST_ADDED = 128  # bytes that a record has on top of its content: header, nonce, MAC and padding


@dataclass(frozen=True, slots=True)
class DtlsSettings:
    mtu: int = 1200  # bytes of a handshake datagram; IPv6 carries 1280 everywhere, with headers of IP, UDP and TURN
    # A certificate chain of RSA keys has some 10 kB, and a path that loses much brings it a few times.
    max_handshake: int = 256 * 1024  # bytes that a peer may send before it is connected


class DtlsState(Enum):
    NEW = "new"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    CLOSED = "closed"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class DtlsConnected:
    """The handshake is done, and the peer's certificate is the one expected."""

    srtp: SrtpKeys | None  # None: the peer did not ask for media


@dataclass(frozen=True, slots=True)
class DtlsData:
    """The content of one record."""

    data: bytes


@dataclass(frozen=True, slots=True)
class DtlsClosed:
    """The peer sent close_notify."""


@dataclass(frozen=True, slots=True)
class DtlsFailed:
    """The connection has failed. Nothing that was encrypted with a wrong peer came through."""

    reason: DtlsFailure
    detail: str  # OpenSSL's reasons; for logs


DtlsEvent = DtlsConnected | DtlsData | DtlsClosed | DtlsFailed


class DtlsNotConnected(RuntimeError):
    """`send` was called before DtlsConnected or after the end."""


class DtlsMessageTooLong(ValueError):
    """`send` was called with more than a record holds."""

    def __init__(self, length: int) -> None:
        self.length = length

    def __str__(self) -> str:
        return f"{self.length} bytes; a record holds {MAX_PLAINTEXT}"


def dtls_context(certificate: Certificate) -> SSL.Context:
    """Return the OpenSSL context that all connections with one certificate share."""
    context = SSL.Context(SSL.DTLS_METHOD)
    context.set_min_proto_version(DTLS_1_2)
    context.set_max_proto_version(
        DTLS_1_2
    )  # OpenSSL 4.0 has no DTLS 1.3, and `records` would have to learn its headers
    context.set_options(SSL.OP_NO_TICKET | SSL.OP_NO_RENEGOTIATION | SSL.OP_NO_QUERY_MTU)
    # No authority signed it: its fingerprint counts, which is checked when the handshake is done.
    context.set_verify(SSL.VERIFY_PEER | SSL.VERIFY_FAIL_IF_NO_PEER_CERT, lambda *arguments: True)
    context.use_certificate(certificate.certificate)
    context.use_privatekey(certificate.key)
    context.set_cipher_list(CIPHERS)
    context.set_tlsext_use_srtp(b":".join(profile.name.encode() for profile in available_profiles()))
    return context


class DtlsConnection:
    """One association. `counts` names the datagrams that were dropped: "not_started", "ended", "not_dtls"."""

    def __init__(
        self,
        context: SSL.Context,
        role: DtlsRole,
        fingerprints: Sequence[Fingerprint],
        settings: DtlsSettings | None = None,
    ) -> None:
        """`fingerprints`: those of the certificates that the peer may have; from its session description."""
        self.role = role
        self.counts: Counter[str] = Counter()
        self._settings = settings or DtlsSettings()
        self._fingerprints = tuple(fingerprints)
        self.state = DtlsState.NEW
        self._ssl = SSL.Connection(context)
        self._ssl.set_ciphertext_mtu(self._settings.mtu)
        self._handshake_bytes = 0
        self._timer: float | None = None
        self._out: list[bytes] = []
        self._events: list[DtlsEvent] = []
        self._is_unread = False  # True: the last datagram may have further records
        self._room = MAX_PLAINTEXT  # bytes of the longest record that may wait: no more than its datagram

    # input

    def start(self, now: float) -> None:
        """Begin the handshake: a client says hello, a server listens."""
        if self.state is not DtlsState.NEW:
            return
        self.state = DtlsState.CONNECTING
        if self.role == "client":
            self._ssl.set_connect_state()
        else:
            self._ssl.set_accept_state()
        self._advance(now)

    def receive_datagram(self, data: bytes, now: float) -> None:
        """Take a datagram with one or more records."""
        self.receive_first(data, now)
        self.read_on(now)

    def receive_first(self, data: bytes, now: float) -> None:
        """Take a datagram, and read its first record only if the connection is up.

        Call `read_on` when that has gone on: it may be a command, and to find out that nothing is behind it takes as
        long again.
        """
        if self._is_unread:
            self.read_on(now)
        if self.state is DtlsState.NEW:
            self.counts["not_started"] += 1
        elif self.state in (DtlsState.CLOSED, DtlsState.FAILED):
            self.counts["ended"] += 1
        elif not data or data[0] not in FIRST_BYTES:
            self.counts["not_dtls"] += 1
        elif self.state is DtlsState.CONNECTED:
            self._room = max(READ_AT_LEAST, len(data))
            self._ssl.bio_write(data)
            self._advance(now, only_first=True)
        else:
            self._handshake_bytes += len(data)
            if self._handshake_bytes > self._settings.max_handshake:
                self._fail("too_much_handshake", f"more than {self._settings.max_handshake} bytes before connected")
                return
            self._ssl.bio_write(data)
            self._advance(now)

    def read_on(self, now: float) -> None:
        """Read what `receive_first` has left. `events` and `datagrams_to_send` may have more then."""
        if self._is_unread:
            self._is_unread = False
            self._advance(now)

    def handle_timer(self, now: float) -> None:
        """Repeat the unanswered flight (RFC 6347 4.2.4), if OpenSSL finds that it is due."""
        if self.state not in (DtlsState.CONNECTING, DtlsState.CONNECTED):
            return
        try:
            self._ssl.DTLSv1_handle_timeout()
        except SSL.Error as error:  # after twelve repeats
            self._fail("timeout", _words(error))
        self._written(now)

    def send(self, data: bytes, now: float) -> None:
        """Send `data`, of at most 16384 bytes, as one record in one datagram. It is not repeated.

        Raises:
            DtlsNotConnected: before DtlsConnected, or after the end.
            DtlsMessageTooLong: `data` does not fit a record.
        """
        if self.state is not DtlsState.CONNECTED:
            raise DtlsNotConnected(f"DTLS is {self.state.value}")
        if len(data) > MAX_PLAINTEXT:
            raise DtlsMessageTooLong(len(data))
        if not data:
            return  # an empty record would tell the peer nothing
        if self._is_unread:
            self._written(now)  # its answer to an earlier record leaves in a datagram of its own
        try:
            self._ssl.send(data)
            # One record, and nothing else was left. Each call of OpenSSL that is spared counts: between two commands,
            # encoders take the processor's caches.
            self._out.append(self._ssl.bio_read(len(data) + MOST_ADDED))
        except SSL.Error as error:
            self._fail("protocol", _words(error))
            self._written(now)

    def close(self, now: float) -> None:
        """Send close_notify (RFC 5246 7.2.1). Idempotent; there is no event."""
        if self.state in (DtlsState.CONNECTING, DtlsState.CONNECTED):
            _shut_down(self._ssl)
            self._written(now)
        if self.state is not DtlsState.FAILED:
            self.state = DtlsState.CLOSED
        self._timer = None

    # output

    def datagrams_to_send(self) -> list[bytes]:
        out, self._out = self._out, []
        return out

    @property
    def has_events(self) -> bool:
        """True if `events` has something."""
        return bool(self._events)

    def events(self) -> list[DtlsEvent]:
        events, self._events = self._events, []
        return events

    def timer(self) -> float | None:
        """Return the time of `handle_timer`: a little late rather than early, because OpenSSL has its own clock."""
        return self._timer

    # OpenSSL

    def _advance(self, now: float, *, only_first: bool = False) -> None:
        """Let OpenSSL read all records that it has, or the first one with data.

        It alone knows how many: it skips only the header of a malformed record, and finds others in its content.
        """
        try:
            if self.state is DtlsState.CONNECTING:
                self._ssl.do_handshake()
                if _is_expected_peer(self._ssl, self._fingerprints):
                    self.state = DtlsState.CONNECTED
                    self._events.append(DtlsConnected(_srtp_keys(self._ssl, self.role)))
                else:
                    _shut_down(self._ssl)
                    self._fail("fingerprint", "the peer's certificate is not the one of its session description")
            while self.state is DtlsState.CONNECTED:
                self._events.append(DtlsData(self._ssl.recv(self._room)))
                if only_first:
                    self._is_unread = True
                    return
        except SSL.WantReadError:
            pass  # all was read
        except SSL.ZeroReturnError:
            _shut_down(self._ssl)  # RFC 5246 7.2.1: answered with the same
            self.state = DtlsState.CLOSED
            self._events.append(DtlsClosed())
        except SSL.Error as error:  # a fatal alert of the peer, or OpenSSL sent one; invalid records are dropped in it
            self._fail("protocol", _words(error))
        self._written(now)

    def _fail(self, reason: DtlsFailure, detail: str) -> None:
        self.state = DtlsState.FAILED
        self._events.append(DtlsFailed(reason, detail))

    def _written(self, now: float) -> None:
        """Take what OpenSSL wrote, and ask for its timer."""
        self._out += _datagrams(_take_written(self._ssl), self._settings.mtu)
        left = None
        if self.state in (DtlsState.CONNECTING, DtlsState.CONNECTED):
            left = self._ssl.DTLSv1_get_timeout()
        self._timer = None if left is None else now + left


def _is_expected_peer(ssl: SSL.Connection, fingerprints: Sequence[Fingerprint]) -> bool:
    certificate = ssl.get_peer_certificate(as_cryptography=True)
    return certificate is not None and is_expected(certificate, fingerprints)


def _srtp_keys(ssl: SSL.Connection, role: DtlsRole) -> SrtpKeys | None:
    selected = ssl.get_selected_srtp_profile().decode()
    profile = next((each for each in available_profiles() if each.name == selected), None)
    if profile is None:
        return None
    material = ssl.export_keying_material(SRTP_LABEL, 2 * (profile.key_length + profile.salt_length))
    return SrtpKeys.split(profile, material, role == "client")


def _shut_down(ssl: SSL.Connection) -> None:
    with suppress(SSL.Error):  # in the middle of a handshake there is nothing to close
        ssl.shutdown()


def _take_written(ssl: SSL.Connection) -> bytes:
    written = b""
    try:
        while True:
            written += ssl.bio_read(WRITTEN_AT_ONCE)
    except SSL.WantReadError:
        return written


def records(data: bytes) -> Iterator[bytes]:
    """Yield the records in `data`, which has only whole ones."""
    start = 0
    while start < len(data):
        end = start + HEADER + int.from_bytes(data[start + 11 : start + HEADER], "big")
        yield data[start:end]
        start = end


def _datagrams(written: bytes, mtu: int) -> Iterator[bytes]:
    """Yield datagrams filled with records: OpenSSL writes to memory, where the borders of its datagrams are lost.

    Records of application data go alone: some peers read only the first of a datagram.
    """
    datagram = b""
    for record in records(written):
        if datagram and (record[0] == APPLICATION_DATA or len(datagram) + len(record) > mtu):
            yield datagram
            datagram = b""
        datagram += record
        if record[0] == APPLICATION_DATA:
            yield datagram
            datagram = b""
    if datagram:
        yield datagram


def _words(error: SSL.Error) -> str:
    """Return OpenSSL's reasons, without the names of its libraries."""
    reasons = error.args[0] if error.args and isinstance(error.args[0], list) else [error.args]
    return "; ".join(str(each[-1]) for each in reasons if each)[:200] or type(error).__name__
