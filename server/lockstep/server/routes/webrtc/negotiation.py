"""The part that WHEP and WHIP have in common: from an offer to its connection, and to the answer's headers."""

import asyncio
from collections.abc import AsyncIterator, Coroutine, Sequence
from contextlib import asynccontextmanager
from typing import Any

from fastapi import Request

from lockstep.rtc.endpoint import Connection, TooManyPeers
from lockstep.rtc.sdp import SdpError
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import BadSdp, ConsoleError, InternalFault, TooManyRequests
from lockstep.server.routes.webrtc.ice import servers_for
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.webrtc.ice_servers import IceServer, IceServers, link_headers

__all__ = ["FRAGMENT", "NEGOTIATION_TIMEOUT", "SDP", "created_headers", "negotiated", "own_servers"]

SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
NEGOTIATION_TIMEOUT = 10.0  # s until STUN and TURN servers have told their addresses


def own_servers(here: Dependencies, identity: Identity) -> Sequence[IceServer]:
    """Return the STUN and TURN servers that the console asks for its own addresses.

    Those candidates are a setting, and a peer's address is learnt from its checks: without the setting none is asked.
    """
    return servers_for(here.settings, identity).ice_servers if here.settings.relay_console else []


@asynccontextmanager
async def negotiated(
    here: Dependencies, opening: Coroutine[Any, Any, Connection], what: str
) -> AsyncIterator[Connection]:
    """Give the connection in which an offer is answered, and close it where the block fails.

    Args:
        opening: the connection, whose addresses are asked for
        what: that fails, for the count of faults

    Raises:
        BadSdp: it cannot be opened in time, or the offer cannot be answered.
        TooManyRequests: there are too many connections.
        InternalFault: the block failed in another way than by an error of the console.
    """
    try:
        async with asyncio.timeout(NEGOTIATION_TIMEOUT):
            connection = await opening
    except TimeoutError as error:
        raise BadSdp("the offer cannot be answered in time") from error
    except TooManyPeers as error:
        raise TooManyRequests("too many connections at this console") from error
    try:
        yield connection
    except BaseException as error:
        connection.close()
        if isinstance(error, SdpError):
            raise BadSdp(str(error)) from error
        if isinstance(error, Exception) and not isinstance(error, ConsoleError):
            here.metrics.faults.caught(what, error)
            raise InternalFault("the console could not answer; its log says why") from error
        raise


def created_headers(request: Request, path: str, tag: str, servers: IceServers) -> dict[str, str]:
    """Return the headers of an answer to an offer (RFC 9725 4.2).

    Args:
        path: of the resource, at this console
        tag: of its ICE session
        servers: STUN and TURN servers that the client may use
    """
    headers = {
        "Location": f"{request.scope.get('root_path', '')}{path}",
        "Accept-Patch": FRAGMENT,
        "Cache-Control": "no-store",
        "ETag": tag,
    }
    if servers.ice_servers:
        headers["Link"] = ", ".join(link_headers(servers))
    return headers
