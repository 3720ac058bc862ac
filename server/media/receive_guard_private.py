"""What a peer sends is handled as it comes, and neither ends its connection nor fills memory.

aiortc and aioice have no public hooks for that. What is used and why:

- `RTCDtlsTransport._recv_next`: an exception there would end the connection
- `RTCDtlsTransport._state`, `.__handshake_done`, `._ssl`, `._write_ssl`, `._rx_srtp`, `._handle_rtcp_data`,
  `._handle_rtp_data`, `._data_receiver`: what `_recv_next` does with a datagram
- `aioice.Connection._queue`: the receive queue, which has no bound
- `aioice.Connection._nominated`: the pair of candidates in use, whose socket slices of observers' work end for
- `RTCRtpReceiver.__remote_bitrate_estimator`: a third of a megabyte of small objects for each picture stream, on which
  nothing of ours depends: the console receives no pictures. A peer that left waits with it for the garbage collector
"""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, cast

import pylibsrtp
from aiortc import RTCPeerConnection, RTCRtpReceiver
from aiortc.rtcdtlstransport import RTCDtlsTransport, State
from aiortc.rtp import is_rtcp
from OpenSSL import SSL

from server.loop_turns import HasFileno
from server.media.receive_turns import ReceiveTurns
from server.run_now import run_now

__all__ = ["guard_transports"]

RECEIVE_QUEUE_DATAGRAMS = 1024
HANDSHAKE_DONE = "_RTCDtlsTransport__handshake_done"
ESTIMATOR = "_RTCRtpReceiver__remote_bitrate_estimator"
COMPONENT = 1  # of ICE: RTP and RTCP are multiplexed
DATAGRAM_MAX = 1500  # bytes, what pylibsrtp takes
MAX_SOURCES = 64  # SSRCs of one peer; a browser that publishes in three layers has twelve


class _TooManySources(pylibsrtp.Error):
    """Handled as what is not from the peer."""


class _FewSources:
    """Stands in for what decrypts SRTP: libsrtp keeps a context for each SSRC, searches all of them and forgets none.

    So does aiortc's table of receivers, which sees only what gets through here.
    """

    def __init__(self, session: pylibsrtp.Session, on_error: Callable[[str], None]) -> None:
        self._session = session
        self._on_error = on_error
        self._sources: set[bytes] = set()

    def unprotect(self, data: bytes) -> bytes:
        return self._take(data, data[8:12], self._session.unprotect)

    def unprotect_rtcp(self, data: bytes) -> bytes:
        return self._take(data, data[4:8], self._session.unprotect_rtcp)

    def _take(self, data: bytes, source: bytes, unprotect: Callable[[bytes], bytes]) -> bytes:
        if source in self._sources:
            return unprotect(data)
        if len(self._sources) >= MAX_SOURCES:
            self._on_error("too_many_sources")
            raise _TooManySources
        plain = unprotect(data)
        self._sources.add(source)  # only now: anybody can write an SSRC
        return plain


class _Intake(asyncio.Queue[Any]):
    """Stands in for an ICE connection's receive queue: handles a datagram as it comes, or in its turn.

    The way through the queue, a task and its coroutines costs more than most datagrams do. Voice goes that way, and so
    does what comes before DTLS is connected, within a bound; published pictures do not. What the connection could not
    use, or what would raise further on, is dropped and counted.
    """

    def __init__(
        self,
        dtls: Any,
        on_error: Callable[[str], None],
        turns: ReceiveTurns | None,
        on_socket: Callable[[HasFileno], None] | None = None,
        at_once: Callable[[], bool] | None = None,
    ) -> None:
        super().__init__()
        self._dtls = dtls
        self._on_error = on_error
        self._turns = turns  # None: everything at once
        self._at_once = at_once  # whether the next one need not wait for its turn; None: every one waits
        self._on_socket = on_socket
        self._pair: Any = None  # of candidates, whose socket was told last
        self._later: deque[bytes] = deque()  # what waits for its turn
        self._awaited = False

    async def get(self) -> Any:
        self._awaited = True
        try:
            return await super().get()
        finally:
            self._awaited = False

    def put_nowait(self, item: tuple[bytes, int] | None) -> None:
        if item is not None and self._on_socket is not None:
            self._tell_socket(self._on_socket)
        if item is None:
            super().put_nowait(None)
        elif not 0 < len(item[0]) <= DATAGRAM_MAX:
            self._on_error("datagram_size")
        elif self.qsize() + len(self._later) >= RECEIVE_QUEUE_DATAGRAMS:
            self._on_error("receive_overflow")
        elif not self._is_idle():
            super().put_nowait(item)
        elif self._turns is not None and (self._later or not self._may_go_at_once()):
            self._later.append(item[0])
            self._turns.add(self)
        elif not self._handled(item[0]):
            super().put_nowait(item)

    @property
    def _always_waits(self) -> bool:
        return self._turns is not None and self._at_once is None

    def _may_go_at_once(self) -> bool:
        return self._at_once is not None and self._at_once()

    def handle_next(self) -> bool:
        """In our turn: one of those that wait; whether there are more."""
        data = self._later.popleft()
        if self._dtls._state is State.CONNECTED and not self._handled(data):
            super().put_nowait((data, COMPONENT))
        return bool(self._later)

    def _tell_socket(self, on_socket: Callable[[HasFileno], None]) -> None:
        pair = self._dtls.transport._connection._nominated.get(COMPONENT)
        if pair is not self._pair:
            self._pair = pair
            socket = None if pair is None else pair.protocol.transport.get_extra_info("socket")
            if socket is not None:  # a relay's transport has none
                on_socket(socket)

    def _is_idle(self) -> bool:
        """Whether DTLS is connected, and waits for just this datagram."""
        dtls = self._dtls
        return self._awaited and self.empty() and dtls._state is State.CONNECTED and getattr(dtls, HANDSHAKE_DONE)

    def _handled(self, data: bytes) -> bool:
        """False when it is to go through the queue."""
        try:
            if 19 < data[0] < 64:
                self._take_record(data)
            elif 127 < data[0] < 192 and is_rtcp(data):
                run_now(self._dtls._handle_rtcp_data(self._dtls._rx_srtp.unprotect_rtcp(data)))
            elif 127 < data[0] < 192 and self._always_waits:  # its turn: not in one go with all that wait
                run_now(self._dtls._handle_rtp_data(self._dtls._rx_srtp.unprotect(data), 0))
            else:
                return False
        except ConnectionError:
            super().put_nowait(None)  # to `RTCDtlsTransport.__run`, which ends the connection
        except pylibsrtp.Error:
            pass  # not from the peer, as aiortc ignores it
        except Exception:  # what a parser of aiortc did not expect
            self._on_error("malformed")
        return True

    def _take_record(self, data: bytes) -> None:
        """As `RTCDtlsTransport._recv_next` does it."""
        dtls = self._dtls
        dtls._ssl.bio_write(data)
        try:
            record = dtls._ssl.recv(DATAGRAM_MAX)
        except SSL.ZeroReturnError as error:
            raise ConnectionError("the peer closed DTLS") from error
        except SSL.Error:
            record = b""
        if not record:
            run_now(dtls._write_ssl())  # alerts and handshake messages are answered, and bring no data
        elif dtls._data_receiver is not None:
            run_now(dtls._data_receiver._handle_data(record))


def guard_transports(
    pc: RTCPeerConnection,
    on_error: Callable[[str], None],
    turns: ReceiveTurns | None = None,
    on_socket: Callable[[HasFileno], None] | None = None,
    at_once: Callable[[], bool] | None = None,
) -> None:
    """Keep what a peer sends from ending its connection or filling memory; `on_error` gets a stable name to count.

    With `turns` its datagrams are handled in its turn, without at once; with `at_once` too, those at once for which it
    says yes while none waits. `on_socket` gets the socket by which they come,
    and another one when that has changed.

    Call after setRemoteDescription, when the transports exist. Calling it again changes nothing.
    """
    for transceiver in pc.getTransceivers():
        _estimate_nothing(transceiver.receiver)
    transports = {transceiver.receiver.transport for transceiver in pc.getTransceivers()}
    if pc.sctp is not None:
        transports.add(pc.sctp.transport)
    for transport in transports:
        _guard_transport(transport, on_error, turns, on_socket, at_once)


def _estimate_nothing(receiver: RTCRtpReceiver) -> None:
    if not hasattr(receiver, ESTIMATOR):
        raise RuntimeError("aiortc moved the bitrate estimator; see server/media/receive_guard_private.py")
    setattr(receiver, ESTIMATOR, None)


def _guard_transport(
    dtls: RTCDtlsTransport,
    on_error: Callable[[str], None],
    turns: ReceiveTurns | None,
    on_socket: Callable[[HasFileno], None] | None,
    at_once: Callable[[], bool] | None,
) -> None:
    connection = dtls.transport._connection
    if isinstance(connection._queue, _Intake):
        return
    if not hasattr(dtls, HANDSHAKE_DONE):
        raise RuntimeError("aiortc moved __handshake_done; see server/media/receive_guard_private.py")
    connection._queue = _Intake(dtls, on_error, turns, on_socket, at_once)
    receive = dtls._recv_next

    async def guarded() -> None:
        _bound_sources(dtls, on_error)  # nothing is decrypted before the first time that this is called when connected
        try:
            await receive()
        except ConnectionError:
            raise
        except Exception:  # what a parser of aiortc did not expect; CancelledError is no Exception
            on_error("malformed")

    cast(Any, dtls)._recv_next = guarded


def _bound_sources(dtls: Any, on_error: Callable[[str], None]) -> None:
    if dtls._rx_srtp is not None and not isinstance(dtls._rx_srtp, _FewSources):
        dtls._rx_srtp = _FewSources(dtls._rx_srtp, on_error)
