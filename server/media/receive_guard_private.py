"""What a peer sends neither ends its connection nor fills memory; aiortc and aioice have no public hooks for that.

What is used and why:

- `RTCDtlsTransport._recv_next`: an exception there would end the connection
- `aioice.Connection._queue`: the receive queue, which has no bound
- `RTCRtpReceiver.__remote_bitrate_estimator`: a third of a megabyte of small objects for each picture stream, on which
  nothing of ours depends: the console receives no pictures. A peer that left waits with it for the garbage collector
"""

import asyncio
from collections.abc import Callable
from typing import Any, cast

from aiortc import RTCPeerConnection, RTCRtpReceiver
from aiortc.rtcdtlstransport import RTCDtlsTransport

__all__ = ["guard_transports"]

RECEIVE_QUEUE_DATAGRAMS = 1024
ESTIMATOR = "_RTCRtpReceiver__remote_bitrate_estimator"
DATAGRAM_MAX = 1500  # bytes, what pylibsrtp takes


class _BoundedReceiveQueue(asyncio.Queue[Any]):
    """Drops what the connection could not use: datagrams beyond the bound, and those that would raise further on."""

    def __init__(self, on_error: Callable[[str], None]) -> None:
        super().__init__()
        self._on_error = on_error

    def put_nowait(self, item: tuple[bytes, int] | None) -> None:
        if item is not None and not 0 < len(item[0]) <= DATAGRAM_MAX:
            self._on_error("datagram_size")
        elif item is not None and self.qsize() >= RECEIVE_QUEUE_DATAGRAMS:
            self._on_error("receive_overflow")
        else:
            super().put_nowait(item)


def guard_transports(pc: RTCPeerConnection, on_error: Callable[[str], None]) -> None:
    """Keep what a peer sends from ending its connection or filling memory; `on_error` gets a stable name to count.

    Call after setRemoteDescription, when the transports exist. Calling it again changes nothing.
    """
    for transceiver in pc.getTransceivers():
        _estimate_nothing(transceiver.receiver)
    transports = {transceiver.receiver.transport for transceiver in pc.getTransceivers()}
    if pc.sctp is not None:
        transports.add(pc.sctp.transport)
    for transport in transports:
        _guard_transport(transport, on_error)


def _estimate_nothing(receiver: RTCRtpReceiver) -> None:
    if not hasattr(receiver, ESTIMATOR):
        raise RuntimeError("aiortc moved the bitrate estimator; see server/media/receive_guard_private.py")
    setattr(receiver, ESTIMATOR, None)


def _guard_transport(dtls: RTCDtlsTransport, on_error: Callable[[str], None]) -> None:
    connection = dtls.transport._connection
    if isinstance(connection._queue, _BoundedReceiveQueue):
        return
    connection._queue = _BoundedReceiveQueue(on_error)
    receive = dtls._recv_next

    async def guarded() -> None:
        try:
            await receive()
        except ConnectionError:
            raise
        except Exception:  # what a parser of aiortc did not expect; CancelledError is no Exception
            on_error("malformed")

    cast(Any, dtls)._recv_next = guarded
