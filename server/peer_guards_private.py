"""Bounds on what a peer can make aiortc and aioice keep; tests pin every private part.

What is used and why:

- `RTCSctpTransport._receive_data_chunk`, `._receive_forward_tsn_chunk`, `._inbound_streams`, `._sack_misordered`,
  `._advertised_rwnd`: aiortc announces a receive window (RFC 9260 6.2) and does not insist on it; a message that never
  ends, holes in the numbering and 65,536 streams would each be kept without bound
- `aioice.stun.parse_message`: raises what its caller does not expect, of a datagram that anybody can send
- `aioice.Connection.check_incoming`, `._remote_candidates`: every address that an authenticated check comes from
  becomes a candidate, and every candidate a check of ours
"""

import struct
from collections.abc import Callable
from typing import Any

import aioice.stun
from aiortc import RTCPeerConnection

__all__ = ["guard_data", "guard_ice"]

RECEIVE_WINDOW = 256 * 1024  # bytes of messages that are not complete
MAX_STREAMS = 16  # we use three
MAX_GAPS = 1024  # chunks that came before an earlier one
MAX_ADDRESSES = 200  # of one peer; a browser has a few

Refused = Callable[[str], None]

_parse_message = aioice.stun.parse_message  # aioice's own


def guard_data(pc: RTCPeerConnection, on_refused: Refused) -> None:
    """Take only what fits; `on_refused` gets a stable name, and should end the peer: SCTP cannot go on with a hole.

    Call after setRemoteDescription(offer), before setLocalDescription.
    """
    sctp: Any = pc.sctp
    if sctp is None:
        return
    take, forward = sctp._receive_data_chunk, sctp._receive_forward_tsn_chunk

    async def take_bounded(chunk: Any) -> None:
        wrong = _too_much(sctp, chunk)
        if wrong:
            on_refused(wrong)
        else:
            await take(chunk)

    async def forward_bounded(chunk: Any) -> None:
        if len({number for number, _ in chunk.streams} | sctp._inbound_streams.keys()) > MAX_STREAMS:
            on_refused("too_many_streams")
        else:
            await forward(chunk)

    sctp._advertised_rwnd = RECEIVE_WINDOW
    sctp._receive_data_chunk = take_bounded
    sctp._receive_forward_tsn_chunk = forward_bounded


def _too_much(sctp: Any, chunk: Any) -> str:
    """What there would be too much of with `chunk`; "" when it fits."""
    if chunk.stream_id not in sctp._inbound_streams and len(sctp._inbound_streams) >= MAX_STREAMS:
        return "too_many_streams"
    if len(chunk.user_data) > sctp._advertised_rwnd:
        return "receive_window"
    if len(sctp._sack_misordered) >= MAX_GAPS:
        return "too_many_gaps"
    return ""


def guard_ice(connection: Any, on_refused: Refused) -> None:
    """Ignore checks from further addresses once there are many. `connection` is one of aioice.

    aioice takes every datagram for a STUN message whose third and fourth byte are its length, as the sequence number
    of an RTP packet may be. What is none after all passes for data, process-wide, and raises nothing.
    """
    aioice.stun.parse_message = _parse_or_refuse
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
