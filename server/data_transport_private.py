"""Private parts of aiortc under the data channels; tests pin every one of them.

What is used and why:

- `RTCSctpTransport._rto`, `._srtt`, `._rttvar`, `._update_rto`, `._t1_expired`, `._t3_expired`, `._cwnd`: it waits at
  least one second before it repeats a lost message, three while it connects, and then sends one packet at a time
- `RTCSctpTransport._transmit`, `._transmit_reconfig`; `._send_chunk`, `._send_reconfig_param` called by `._t1_expired`,
  `._t2_expired`, `._reconfig_timer_expired`: run in tasks that nobody awaits, and raise there when the connection has
  ended, or while it ends: between its goodbye and the end of its task OpenSSL refuses what aiortc still sends
- `RTCSctpTransport._data_channel_flush`, `._data_channel_send`: each message is sent by a task of its own
- `RTCSctpTransport._send_sack`, `._sack_needed`, `._sack_misordered`, `._sack_duplicates`: every single packet is
  acknowledged
- `RTCSctpTransport._handle_data`, `RTCDtlsTransport._ssl`: one record is taken from OpenSSL for each datagram that
  comes in. A record that waits there, as one that overtook the end of the handshake does, is never caught up with:
  from then on every message is one datagram late
"""

import asyncio
import contextlib
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

from aiortc import RTCDataChannel, RTCPeerConnection
from aiortc.rtcsctptransport import USERDATA_MAX_LENGTH, SackChunk
from OpenSSL import SSL

from server.data_short_cuts_private import ShortCuts
from server.run_now import run_now

__all__ = ["tune_data_transport"]

RETRANSMISSION_FLOOR = 0.3  # s; above a browser's delayed acknowledgement (0.2 s, RFC 9260 6.2)
RETRANSMISSION_CEILING = 1.5  # s; on a path whose shortest round trip is longer than half of it, twice that
SAMPLES = 8  # of the round trip, of which the shortest is the path's and not an outage's
RETRANSMISSION_START = 0.5  # s before the first measured round trip
CONNECT_CEILING = 3.0  # s, to which the interval grows while nobody answers; aiortc gives up after eight
ACKNOWLEDGEMENT_DELAY = 0.15  # s; RFC 9260 6.2 allows 0.5 and recommends 0.2
ENDED = (ConnectionError, SSL.Error)  # what sending raises when the connection has ended
RECORD = 1500  # bytes, the most that a DTLS record carries here
WINDOW_FLOOR = 8 * USERDATA_MAX_LENGTH  # bytes that may be unacknowledged after a timeout
# The same for who drives, whatever was lost: the answers to two salvos of a command's copies. Else the newest feedback
# waits for a timeout behind answers that are lost.
DRIVING_WINDOW_FLOOR = 24 * USERDATA_MAX_LENGTH


def tune_data_transport(pc: RTCPeerConnection, *, observes: bool = False) -> None:
    """Let data channels take what has come, and find out about a loss soon. Nothing to do for a peer without any.

    Who `observes` has few acknowledgements, and a small window after a loss. Somebody who drives has an acknowledgement
    for each packet and a window of his own: where some are lost, neither what he sends nor his feedback may wait.

    Call after setRemoteDescription(offer), before setLocalDescription. Once per connection.
    """
    if pc.sctp is not None:
        short_cuts = ShortCuts(pc.sctp, _Acknowledgements(pc.sctp).take if observes else bytes)
        _drain_dtls(pc.sctp, short_cuts)
        _hasten_sctp(pc.sctp)
        if not observes:
            _keep_window(pc.sctp)
        _end_in_silence(pc.sctp)
        _send_at_once(pc.sctp, short_cuts)


def _drain_dtls(sctp: Any, short_cuts: ShortCuts) -> None:
    """With every datagram, take all records that OpenSSL has, not only the first."""
    handle = sctp._handle_data

    async def handle_all(data: bytes) -> None:
        record: bytes | None = data
        while record is not None:
            if not short_cuts.take(record):
                await handle(record)
            record = _next_record(sctp.transport)

    sctp._handle_data = handle_all


def _next_record(transport: Any) -> bytes | None:
    try:
        record: bytes = transport._ssl.recv(RECORD)
    except SSL.ZeroReturnError as error:
        raise ConnectionError("the peer closed DTLS") from error
    except SSL.Error:
        return None  # nothing more
    return record or None


def _hasten_sctp(sctp: Any) -> None:
    """Repeat a lost message sooner, and go on sending after a loss.

    What a peer gets on data channels is some kilobytes a second, so that neither a timeout of less than a second
    (RFC 9260 16 leaves RTO.Min to the application's needs) nor a window of a few packets after one can congest a path.
    """
    measure = sctp._update_rto
    expire_connecting, expire_sending = sctp._t1_expired, sctp._t3_expired

    samples: deque[float] = deque(maxlen=SAMPLES)

    def update(round_trip: float) -> None:
        measure(round_trip)
        samples.append(round_trip)
        # A network that was cut and delivers everything at its end is no path of ten seconds: with a wait of that
        # order, whatever is lost next would keep the operator from the seat for as long.
        ceiling = max(RETRANSMISSION_CEILING, 2 * min(samples))
        sctp._rto = min(max(RETRANSMISSION_FLOOR, sctp._srtt + 4 * sctp._rttvar), ceiling)

    def expired_connecting() -> None:
        # The wait grows: eight short ones would end before a path that was gone for five seconds is back.
        sctp._rto = min(2 * sctp._rto, CONNECT_CEILING)
        expire_connecting()

    def expired_sending() -> None:
        expire_sending()
        sctp._cwnd = max(sctp._cwnd, WINDOW_FLOOR)

    sctp._rto = RETRANSMISSION_START
    sctp._update_rto = update
    sctp._t1_expired = expired_connecting
    sctp._t3_expired = expired_sending


def _end_in_silence(sctp: Any) -> None:
    """What is sent in a task that nobody awaits raises nothing when the connection has ended.

    Not around every single packet: the end of the connection must keep aiortc from starting its timer again.
    """
    for name in ("_transmit", "_transmit_reconfig"):
        setattr(sctp, name, _or_not(getattr(sctp, name)))
    timers = {"_t1_expired": "_send_chunk", "_t2_expired": "_send_chunk"}
    for timer, send in {**timers, "_reconfig_timer_expired": "_send_reconfig_param"}.items():
        setattr(sctp, timer, _sending_or_not(sctp, getattr(sctp, timer), send))


def _or_not(send: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    async def send_or_not(*what: Any) -> None:
        with contextlib.suppress(*ENDED):
            await send(*what)

    return send_or_not


def _sending_or_not(sctp: Any, expire: Callable[[], None], name: str) -> Callable[[], None]:
    """`expire`, during which what is called `name` does not raise."""

    def expired() -> None:
        send = getattr(sctp, name)
        setattr(sctp, name, _or_not(send))
        try:
            expire()
        finally:
            setattr(sctp, name, send)

    return expired


def _keep_window(sctp: Any) -> None:
    """Nothing that is lost may keep the newest feedback from who drives."""
    handle, expire_sending = sctp._handle_data, sctp._t3_expired

    async def handle_and_keep(data: bytes) -> None:
        await handle(data)
        sctp._cwnd = max(sctp._cwnd, DRIVING_WINDOW_FLOOR)

    def expired_sending() -> None:
        expire_sending()
        sctp._cwnd = max(sctp._cwnd, DRIVING_WINDOW_FLOOR)
        # What waited behind it; aiortc would wait for an acknowledgement.
        asyncio.get_running_loop().call_soon(sctp._data_channel_flush)

    sctp._cwnd = max(sctp._cwnd, DRIVING_WINDOW_FLOOR)
    sctp._handle_data = handle_and_keep
    sctp._t3_expired = expired_sending


def _send_at_once(sctp: Any, short_cuts: ShortCuts) -> None:
    """Send a message in the turn of the loop that it was given in: a task would cost more than the sending.

    aiortc passes what `_data_channel_flush` returns to `asyncio.ensure_future`, which takes a future for what it is.
    """
    flush, send = sctp._data_channel_flush, sctp._data_channel_send
    flushed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    flushed.set_result(None)
    is_flushing = False

    def flush_now() -> asyncio.Future[None]:
        nonlocal is_flushing
        if not is_flushing:  # else a listener sends another message, which the flush under way comes to
            is_flushing = True
            try:
                run_now(flush())
            except ENDED:
                pass  # the connection has ended
            finally:
                is_flushing = False
        return flushed

    def send_now(channel: RTCDataChannel, data: bytes | str) -> None:
        nonlocal is_flushing
        if is_flushing or not isinstance(data, str):
            send(channel, data)
            return
        is_flushing = True
        try:
            sent = short_cuts.send(channel, data)
        except ENDED:
            sent = True  # to nobody: the connection has ended
        finally:
            is_flushing = False
        if not sent:
            send(channel, data)
        elif sctp._data_channel_queue:  # a listener has sent another message
            flush_now()

    sctp._data_channel_flush = flush_now
    sctp._data_channel_send = send_now


class _Acknowledgements:
    """Acknowledge with the next message, with every second packet, or after a while (RFC 9260 6.2), as browsers do.

    At once when something is missing or came twice: the sender is to find out soon.
    """

    def __init__(self, sctp: Any) -> None:
        self._sctp = sctp
        self._acknowledge = sctp._send_sack
        self._timer: asyncio.TimerHandle | None = None
        sctp._send_sack = self._send_soon

    def take(self) -> bytes:
        """The SACK chunk for a packet that leaves now; empty when none is due, or when it is not a plain one."""
        sctp = self._sctp
        if self._timer is None and not sctp._sack_needed or sctp._sack_misordered or sctp._sack_duplicates:
            return b""
        self._forget()
        sack = SackChunk()
        sack.cumulative_tsn = sctp._last_received_tsn
        sack.advertised_rwnd = max(0, sctp._advertised_rwnd)
        return bytes(sack)

    async def _send_soon(self) -> None:
        sctp = self._sctp
        if self._timer is None and not sctp._sack_misordered and not sctp._sack_duplicates:
            sctp._sack_needed = False
            self._timer = asyncio.get_running_loop().call_later(ACKNOWLEDGEMENT_DELAY, self._send_late)
            return
        self._forget()
        await self._acknowledge()

    def _send_late(self) -> None:
        self._timer = None
        if self._sctp.state == "connected":
            with contextlib.suppress(*ENDED):  # the connection ends meanwhile
                run_now(self._acknowledge())

    def _forget(self) -> None:
        self._sctp._sack_needed = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
