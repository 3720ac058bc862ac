"""The two things that a console does with SCTP a thousand times a second, done in one go: a small message, and its
acknowledgement.

aiortc does both right, in a dozen coroutines each; with two hundred observers they are most of a console's work.
Whatever is not the plain case goes the long way: an association that is not up, a message of several chunks, anything
that waits, was lost, or is to be repeated.

What is used of aiortc, pinned by tests: what `RTCSctpTransport._send`, `._transmit`, `._receive_sack_chunk`,
`._update_rto` and `._handle_data` do, and the state that they keep; `RTCDtlsTransport._send_data`.
"""

import time
from collections.abc import Callable
from struct import Struct
from typing import Any

from aiortc import RTCDataChannel
from aiortc.rtcsctptransport import (
    SCTP_DATA_FIRST_FRAG,
    SCTP_DATA_LAST_FRAG,
    SCTP_DATA_UNORDERED,
    USERDATA_MAX_LENGTH,
    WEBRTC_STRING,
    DataChunk,
    RTCSctpTransport,
    SackChunk,
)
from aiortc.utils import uint16_add, uint32_gt, uint32_gte
from google_crc32c import value as crc32c

from server.run_now import run_now

__all__ = ["ShortCuts"]

ESTABLISHED = RTCSctpTransport.State.ESTABLISHED
TSN_MODULO = 1 << 32
LONGEST_ROUND_TRIP = 15.0  # s; what is longer is no path, but a clock that was set
SACK_CHUNK = 16  # bytes of one without gaps and duplicates (RFC 9260 3.3.4)
SACK_LENGTH = 12 + SACK_CHUNK  # of a packet that is such a one and nothing else

_common_header = Struct("!HHL")  # ports, verification tag; the checksum follows
_checksum = Struct("<L")
_data_header = Struct("!BBHLHHL")  # RFC 9260 3.3.1
_sack = Struct("!BBHLLHH")


class ShortCuts:
    """Of one association. `acknowledgement` takes the SACK chunk that is due, to travel with a message; or empty."""

    def __init__(self, sctp: Any, acknowledgement: Callable[[], bytes]) -> None:
        self._sctp = sctp
        self._acknowledgement = acknowledgement
        self._take_round_trip: Callable[[float], None] = sctp._update_rto
        sctp._update_rto = self._round_trip

    def send(self, channel: RTCDataChannel, text: str) -> bool:
        """Send a message as `RTCSctpTransport._send` does. False, and nothing done, when it is not the plain case.

        Raises:
            ConnectionError, OpenSSL.SSL.Error: the connection has ended.
        """
        sctp = self._sctp
        payload = text.encode()
        most = min(USERDATA_MAX_LENGTH, sctp._remote_max_message_size or USERDATA_MAX_LENGTH)
        if (
            not 0 < len(payload) <= most
            or not self._is_plain()
            or sctp._data_channel_queue
            or sctp._reconfig_queue
            or sctp._flight_size >= sctp._cwnd
            or channel.id is None
            or channel.maxPacketLifeTime is not None
        ):
            return False
        channel._addBufferedAmount(len(payload))
        chunk = self._chunk(channel, payload)
        sctp._sent_queue.append(chunk)
        acknowledgement = self._acknowledgement() if len(payload) <= USERDATA_MAX_LENGTH - SACK_CHUNK else b""
        run_now(sctp.transport._send_data(self._packet(acknowledgement + bytes(chunk))))
        if sctp._t3_handle is None:
            sctp._t3_start()
        channel._addBufferedAmount(-len(payload))
        return True

    def take(self, packet: bytes) -> bool:
        """Take a packet that is one SACK, as `RTCSctpTransport._handle_data` does. False when it is anything else."""
        sctp = self._sctp
        if (
            len(packet) != SACK_LENGTH
            or packet[12] != SackChunk.type
            or not self._is_plain()
            or sctp._data_channel_queue
            or sctp._flight_size >= sctp._cwnd
        ):
            return False
        _, _, length, acknowledged, _, gaps, duplicates = _sack.unpack_from(packet, 12)
        _, _, tag = _common_header.unpack_from(packet)
        if gaps or duplicates or length != SACK_CHUNK or tag != sctp._local_verification_tag:
            return False
        if _checksum.unpack_from(packet, 8)[0] != crc32c(packet[:8] + bytes(4) + packet[12:]):
            return False
        if not uint32_gt(sctp._last_sacked_tsn, acknowledged):
            self._acknowledged(acknowledged)
        return True

    def _is_plain(self) -> bool:
        """Nothing waits to be sent, was given up, or is to be repeated."""
        sctp = self._sctp
        return (
            sctp._association_state is ESTABLISHED
            and not sctp._outbound_queue
            and sctp._forward_tsn_chunk is None
            and sctp._fast_recovery_exit is None
            and not sctp._forward_tsn_streams
            and not uint32_gt(sctp._advanced_peer_ack_tsn, sctp._last_sacked_tsn)
            and not any(chunk._retransmit or chunk._abandoned for chunk in sctp._sent_queue)
        )

    def _chunk(self, channel: RTCDataChannel, payload: bytes) -> Any:
        """A message of one chunk that leaves now."""
        sctp = self._sctp
        chunk: Any = DataChunk(flags=SCTP_DATA_FIRST_FRAG | SCTP_DATA_LAST_FRAG)
        if channel.ordered:
            chunk.stream_seq = sctp._outbound_stream_seq.get(channel.id, 0)
            sctp._outbound_stream_seq[channel.id] = uint16_add(chunk.stream_seq, 1)
        else:
            chunk.flags |= SCTP_DATA_UNORDERED
        chunk.tsn = sctp._local_tsn
        sctp._local_tsn = (chunk.tsn + 1) % TSN_MODULO
        chunk.stream_id = channel.id
        chunk.protocol = WEBRTC_STRING
        chunk.user_data = payload
        chunk._abandoned = chunk._acked = chunk._retransmit = False
        chunk._book_size = len(payload)
        chunk._expiry = None
        chunk._in_flight = True
        chunk._max_retransmits = channel.maxRetransmits
        chunk._misses = 0
        chunk._sent_count = 1
        chunk._sent_time = time.time()
        sctp._flight_size += chunk._book_size
        return chunk

    def _round_trip(self, seconds: float) -> None:
        """A round trip as aiortc measures it, by the wall clock: one that was set meanwhile has measured nothing."""
        if 0 <= seconds <= LONGEST_ROUND_TRIP:
            self._take_round_trip(seconds)

    def _packet(self, chunks: bytes) -> bytes:
        sctp = self._sctp
        header = _common_header.pack(sctp._local_port, sctp._remote_port, sctp._remote_verification_tag)
        return header + _checksum.pack(crc32c(header + bytes(4) + chunks)) + chunks

    def _acknowledged(self, tsn: int) -> None:
        """Everything up to this one has arrived."""
        sctp = self._sctp
        sctp._last_sacked_tsn = tsn
        sent = sctp._sent_queue
        first = None
        while sent and uint32_gte(tsn, sent[0].tsn):
            chunk = sent.popleft()
            sctp._flight_size_decrease(chunk)
            first = first or chunk
        if first is not None and first._sent_count == 1:
            sctp._update_rto(time.time() - first._sent_time)
        if not sent:
            sctp._t3_cancel()
        elif first is not None:
            sctp._t3_restart()
        if uint32_gt(tsn, sctp._advanced_peer_ack_tsn):
            sctp._advanced_peer_ack_tsn = tsn
