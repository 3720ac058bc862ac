"""ICE restart under a connection that lives on (RFC 8445 9, RFC 8842 5.1): the offering side.

A second ICE connection is gathered beside the first, its credentials go to the console, and once it is connected DTLS
moves over to it: data channels, media and all that is in flight stay. `server/ice_restart_private.py` does the same on
the other side; neither may import the other.

Private parts of aiortc and aioice that are used, pinned by tests/client/test_ice_restart.py:

- `RTCIceGatherer._connection`, `._remote_candidates_end`, `RTCIceTransport._connection`, `._recv`, `._send`: what DTLS
  sends and receives with
- `RTCIceTransport.__monitor_task`, `._monitor`: it takes the end of the connection that it watches for the end of all
- `aioice.Connection._queue`, `._query_consent_task`: the receive queue, and the checks that would end an old connection
"""

import asyncio
from collections.abc import Sequence
from typing import Any

from aiortc import RTCIceCandidate, RTCIceGatherer, RTCPeerConnection
from aiortc.rtcicetransport import candidate_to_aioice
from aiortc.sdp import candidate_from_sdp, candidate_to_sdp

from client.aiortc_private import gather_here, transport_of
from robot_bridge.protocol.ice_consent import keep_consent

__all__ = ["IceRestart"]

MONITOR = "_RTCIceTransport__monitor_task"  # mangled: aiortc has no way to watch another connection


class _DataOnly:
    """A receive queue that passes datagrams on, and not the None by which a connection says that it has ended."""

    def __init__(self, queue: Any) -> None:
        self._queue = queue

    def put_nowait(self, item: tuple[bytes, int] | None) -> None:
        if item is not None:
            self._queue.put_nowait(item)


class IceRestart:
    """One restart. Order: `gather`, `fragment`, `connect`; `close` always."""

    def __init__(self, pc: RTCPeerConnection, gatherer: RTCIceGatherer, addresses: Sequence[str] | None) -> None:
        """`addresses`: host candidates on exactly these, loopback included; None: what aioice finds."""
        self._transport: Any = transport_of(pc).transport
        self._gatherer = gatherer
        connection: Any = gatherer._connection
        self._next = connection
        keep_consent(connection)
        self._next._queue = _DataOnly(self._transport._connection._queue)
        if addresses is not None:
            gather_here(self._next, addresses)

    async def gather(self) -> None:
        await self._gatherer.gather()
        self._next.ice_controlling = self._transport._connection.ice_controlling

    def fragment(self, kind: str, mid: str) -> str:
        """What the console has to know (RFC 8840 9): our new credentials and all our candidates."""
        local = self._gatherer.getLocalParameters()
        candidates = [f"a=candidate:{candidate_to_sdp(each)}" for each in self._gatherer.getLocalCandidates()]
        lines = [f"a=ice-ufrag:{local.usernameFragment}", f"a=ice-pwd:{local.password}"]
        lines += [f"m={kind} 9 UDP/TLS/RTP/SAVPF 0", f"a=mid:{mid}", *candidates, "a=end-of-candidates"]
        return "\r\n".join(lines) + "\r\n"

    async def connect(self, answer: str) -> None:
        """Connect by the console's fragment, and move over.

        Raises:
            ValueError: the fragment lacks something, or a candidate cannot be read.
            ConnectionError: no path was found; the old one is untouched.
        """
        fields = [line.partition(":") for line in answer.splitlines()]
        self._next.remote_username = _only(fields, "a=ice-ufrag")
        self._next.remote_password = _only(fields, "a=ice-pwd")
        for name, _, value in fields:
            if name == "a=candidate":
                await self._next.add_remote_candidate(candidate_to_aioice(_candidate(value)))
        await self._next.add_remote_candidate(None)
        await self._next.connect()
        self._next = _swap(self._transport, self._next)

    async def close(self) -> None:
        """Ends whichever of the two connections is not used now."""
        await self._next.close()


def _candidate(value: str) -> RTCIceCandidate:
    try:
        return candidate_from_sdp(value)
    except Exception as error:  # aiortc's parser has no error of its own
        raise ValueError("a candidate that is not valid") from error


def _only(fields: list[tuple[str, str, str]], wanted: str) -> str:
    for name, _, value in fields:
        if name == wanted:
            return value.strip()
    raise ValueError(f"the answer has no {wanted.removeprefix('a=')}")


def _swap(transport: Any, connection: Any) -> Any:
    """Let DTLS send and receive through `connection`; what it used until now."""
    old = transport._connection
    if not hasattr(transport, MONITOR):
        raise RuntimeError("aiortc moved RTCIceTransport.__monitor_task; see client/ice_restart_private.py")
    monitor = getattr(transport, MONITOR)
    if monitor is not None:
        monitor.cancel()
    connection._queue, old._queue = old._queue, _DataOnly(old._queue)
    transport.iceGatherer._connection = connection
    transport.iceGatherer._remote_candidates_end = True
    transport._connection = connection
    transport._recv = connection.recv
    transport._send = connection.send
    setattr(transport, MONITOR, asyncio.ensure_future(transport._monitor()))
    if old._query_consent_task is not None:
        old._query_consent_task.cancel()
    return old
