"""Bounds on what a peer can make aiortc and aioice keep; tests pin every private part.

What is used and why:

- `RTCSctpTransport._receive_data_chunk`, `._receive_forward_tsn_chunk`, `._inbound_streams`, `._sack_misordered`,
  `._last_received_tsn`, `._advertised_rwnd`: aiortc announces a receive window (RFC 9260 6.2) and does not insist on
  it; a message that never ends, holes in the numbering and 65,536 streams would each be kept without bound
- `aioice.stun.parse_message`: raises what its caller does not expect, of a datagram that anybody can send
- `aioice.ice.StunProtocol.datagram_received`, `.receiver`, `.transactions`, `aioice.Connection.local_username`: a check
  with false credentials would be parsed, hashed and answered, and anybody can send ten thousand a second
- `aioice.Connection.check_incoming`, `._remote_candidates`: every address that an authenticated check comes from
  becomes a candidate, and every candidate a check of ours
- `aioice.Connection._nominated`, `aioice.Candidate._network_host`: where the peer is. aioice hands on what is no STUN
  from any address, and until DTLS is connected anybody's alert or hello ends the handshake
"""

import struct
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import aioice.ice
import aioice.stun
from aiortc import RTCPeerConnection
from aiortc.rtcsctptransport import SCTP_DATA_UNORDERED, ForwardTsnChunk
from aiortc.utils import uint32_gt, uint32_gte

from server.token_bucket import TokenBucket

__all__ = ["guard_data", "guard_ice"]

RECEIVE_WINDOW = 256 * 1024  # bytes of messages that are not complete
MAX_STREAMS = 16  # we use three
MAX_GAPS = 1024  # chunks that came before an earlier one
ENOUGH_GAPS = 64  # so many, and what is missing before them is looked at
GIVEN_UP_SECONDS = 5.0  # after which a chunk that may be given up is not repeated any more
MAX_ADDRESSES = 200  # of one peer; a browser has a few
CHECK_RATE, CHECK_BURST = 200.0, 1000.0  # Hz, connectivity checks of one peer; it paces them at 50 (RFC 8445 14.2)
STRAY_RATE, STRAY_BURST = 200.0, 400.0  # Hz, what comes from elsewhere once DTLS knows what is the peer's
COMPONENT = 1  # of ICE: RTP and RTCP are multiplexed
STUN_HEADER = 20  # bytes
STUN_BELOW = 4  # RFC 7983 7: the first byte of a STUN message

Refused = Callable[[str], None]

_parse_message = aioice.stun.parse_message  # aioice's own
_datagram_received = aioice.ice.StunProtocol.datagram_received  # likewise


def guard_data(pc: RTCPeerConnection, on_refused: Refused, clock: Callable[[], float] = time.monotonic) -> None:
    """Take only what fits; `on_refused` gets a stable name, and should end the peer: SCTP cannot go on with a hole.

    It can where the peer has given up the chunk and does not say so: Firefox gives up a lost message of a channel
    without retransmissions, sends no FORWARD TSN for it (RFC 3758 3.5) while other data flow, and everything after it
    would count as out of order for the rest of the connection.

    Call after setRemoteDescription(offer), before setLocalDescription.
    """
    sctp: Any = pc.sctp
    if sctp is None:
        return
    take, forward = sctp._receive_data_chunk, sctp._receive_forward_tsn_chunk
    seen = _Seen()

    async def take_bounded(chunk: Any) -> None:
        wrong = _too_much(sctp, chunk)
        if wrong:
            on_refused(wrong)
            return
        await take(chunk)
        given_up = seen.take(chunk.tsn, clock())
        if given_up is None or len(sctp._sack_misordered) < ENOUGH_GAPS:
            return
        if _waits_for_a_missing_message(sctp, given_up):
            on_refused("message_missing")
        elif uint32_gt(given_up, sctp._last_received_tsn):
            skip = ForwardTsnChunk()
            skip.cumulative_tsn = given_up
            await forward(skip)

    async def forward_bounded(chunk: Any) -> None:
        if len({number for number, _ in chunk.streams} | sctp._inbound_streams.keys()) > MAX_STREAMS:
            on_refused("too_many_streams")
        else:
            await forward(chunk)

    sctp._advertised_rwnd = RECEIVE_WINDOW
    sctp._receive_data_chunk = take_bounded
    sctp._receive_forward_tsn_chunk = forward_bounded


class _Seen:
    """The highest chunk number of each moment: what is missing below that of `GIVEN_UP_SECONDS` ago comes no more."""

    def __init__(self) -> None:
        self._highest: int | None = None
        self._marks: deque[tuple[float, int]] = deque()  # one a second

    def take(self, number: int, now: float) -> int | None:
        """One more; the number up to which nothing comes any more. None: not known yet."""
        if self._highest is None or uint32_gt(number, self._highest):
            self._highest = number
        if not self._marks or now - self._marks[-1][0] >= 1.0:
            self._marks.append((now, self._highest))
        while len(self._marks) > 1 and now - self._marks[1][0] >= GIVEN_UP_SECONDS:
            self._marks.popleft()
        since, highest = self._marks[0]
        return highest if now - since >= GIVEN_UP_SECONDS else None


def _waits_for_a_missing_message(sctp: Any, number: int) -> bool:
    """Whether an ordered message below `number` waits for one before it, which then was not given up."""
    return any(
        not chunk.flags & SCTP_DATA_UNORDERED and uint32_gte(number, chunk.tsn)
        for stream in sctp._inbound_streams.values()
        for chunk in stream.reassembly
    )


def _too_much(sctp: Any, chunk: Any) -> str:
    """What there would be too much of with `chunk`; "" when it fits."""
    if chunk.stream_id not in sctp._inbound_streams and len(sctp._inbound_streams) >= MAX_STREAMS:
        return "too_many_streams"
    if len(chunk.user_data) > sctp._advertised_rwnd:
        return "receive_window"
    if len(sctp._sack_misordered) >= MAX_GAPS:
        return "too_many_gaps"
    return ""


def guard_ice(connection: Any, on_refused: Refused, is_secured: Callable[[], bool] = lambda: True) -> None:
    """Ignore checks from further addresses once there are many. `connection` is one of aioice.

    `is_secured`: whether DTLS is connected. Before that nothing passes from an address that neither the peer has named
    nor a check of it has come from; afterwards a little, so that a NAT may give the peer another address.

    aioice takes every datagram for a STUN message whose third and fourth byte are its length, as the sequence number
    of an RTP packet may be. What is none after all passes for data, process-wide, and raises nothing.
    """
    aioice.stun.parse_message = _parse_or_refuse
    vars(aioice.ice)["StunProtocol"].datagram_received = _take_datagram
    connection.stun_budget = TokenBucket(CHECK_RATE, CHECK_BURST, time.monotonic())
    connection.stray_budget = TokenBucket(STRAY_RATE, STRAY_BURST, time.monotonic())
    connection.is_secured = is_secured
    connection.stun_refused = on_refused
    check = connection.check_incoming

    def check_bounded(message: Any, address: tuple[str, int], protocol: Any) -> None:
        known = connection._remote_candidates
        if len(known) >= MAX_ADDRESSES and not any((each.host, each.port) == address for each in known):
            on_refused("too_many_addresses")
        else:
            check(message, address, protocol)

    connection.check_incoming = check_bounded


def _parse_or_refuse(data: bytes) -> aioice.stun.Message:
    try:
        return _parse_message(data)
    except struct.error as error:
        raise ValueError("a STUN attribute of the wrong length") from error


def _take_datagram(protocol: Any, data: bytes, address: tuple[Any, ...]) -> None:
    """Before anything is parsed: what cannot be for us, or is more than a peer has to say, goes no further."""
    connection = protocol.receiver
    if data and hasattr(connection, "stun_budget"):
        wrong = _no_stun_of_ours(protocol, data) if data[0] < STUN_BELOW else _stray(connection, address)
        if wrong:
            connection.stun_refused(wrong)
            return
    _datagram_received(protocol, data, address)


def _no_stun_of_ours(protocol: Any, data: bytes) -> str:
    """Why it is not looked at; "" when it is."""
    if len(data) < STUN_HEADER:
        return "stun_malformed"
    if data[0] & 0x01:  # a response, or an error
        return "" if data[8:STUN_HEADER] in protocol.transactions else "stun_unasked"
    connection = protocol.receiver
    if f"{connection.local_username}:".encode() not in data:
        return "stun_unknown_user"
    return "" if connection.stun_budget.take(time.monotonic()) else "stun_too_often"


def _stray(connection: Any, address: tuple[Any, ...]) -> str:
    """Why data from this address are not looked at; "" when they are."""
    where = address[0], address[1]
    pair = connection._nominated.get(COMPONENT)
    if pair is not None and pair.remote_addr == where:
        return ""
    if any((each._network_host, each.port) == where for each in connection._remote_candidates):
        return ""
    passes = connection.is_secured() and connection.stray_budget.take(time.monotonic())
    return "" if passes else "unknown_address"
