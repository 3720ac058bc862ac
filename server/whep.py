"""WHEP signalling (draft-ietf-wish-whep): POST an offer, PATCH candidates, DELETE to end."""

import asyncio
import ipaddress
from typing import Annotated, Literal

import structlog
from aiortc import RTCPeerConnection, RTCSessionDescription
from aiortc.sdp import SessionDescription, candidate_from_sdp
from fastapi import APIRouter, Depends, Request, Response

from server.access import Identity
from server.body import read_text
from server.data_transport_private import tune_data_transport
from server.errors import BadSdp, BadSdpFragment, ConsoleError, NotFound, RobotUnreachable
from server.media.aiortc_private import create_peer_connection
from server.offer import parse_fragment, prepare_offer
from server.peer import Peer
from server.services import Services, authorized, services

__all__ = ["router"]

SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
NEGOTIATION_TIMEOUT = 10.0  # s for all that aiortc does between offer and answer

log = structlog.get_logger(__name__)
router = APIRouter()


@router.post("/whep")
async def create(
    request: Request,
    identity: Annotated[Identity, Depends(authorized)],
    stamp: Literal["trailer"] | None = None,
) -> Response:
    """An offer in, an answer out; the peer lives on until DELETE, or until its connection ends."""
    here = services(request)
    offer = prepare_offer(await read_text(request, SDP, here.settings.max_sdp_bytes))
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    with here.console.peers.place():
        peer, answer = await _negotiate(here, identity, offer, trailer=stamp == "trailer")
        here.console.peers.admit(peer)
    headers = {"Location": f"/whep/{peer.resource}", "Accept-Patch": FRAGMENT, "Cache-Control": "no-store"}
    return Response(answer, status_code=201, media_type=SDP, headers=headers)


@router.patch("/whep/{resource}")
async def trickle(resource: str, request: Request, identity: Annotated[Identity, Depends(authorized)]) -> Response:
    """More candidates (RFC 8840). An ICE restart is refused: a new connection is as quick and always clean."""
    here = services(request)
    peer = _own(here, resource, identity)
    text = await read_text(request, FRAGMENT, here.settings.max_sdp_bytes)
    first = SessionDescription.parse(peer.pc.remoteDescription.sdp).media[0]
    candidates = parse_fragment(text, "" if first.ice is None else first.ice.usernameFragment or "", first.rtp.muxId)
    for each in candidates:
        if ".local " in each.line:
            continue  # prepare_offer says why
        try:
            candidate = candidate_from_sdp(each.line.removeprefix("candidate:"))
            ipaddress.ip_address(candidate.ip)
            candidate.sdpMid = each.mid
            await peer.pc.addIceCandidate(candidate)
        except Exception as error:
            # aiortc's parser has no error of its own.
            raise BadSdpFragment("a candidate that is not valid") from error
    return Response(status_code=204)


@router.delete("/whep/{resource}")
async def delete(resource: str, request: Request, identity: Annotated[Identity, Depends(authorized)]) -> Response:
    _own(services(request), resource, identity).end("deleted")
    return Response(status_code=200)


def _own(here: Services, resource: str, identity: Identity) -> Peer:
    """The peer of this resource; somebody else's is as good as none."""
    peer = here.console.peers.by_resource(resource)
    if peer.identity.token_id != identity.token_id:
        raise NotFound("no such WHEP resource")
    return peer


async def _negotiate(here: Services, identity: Identity, offer: str, *, trailer: bool) -> tuple[Peer, str]:
    # No STUN server: our host candidates are a setting, the peer's address is learnt from its checks.
    pc = create_peer_connection()
    try:
        async with asyncio.timeout(NEGOTIATION_TIMEOUT):
            await pc.setRemoteDescription(RTCSessionDescription(offer, "offer"))
            tune_data_transport(pc)
            media = here.media.attach(pc, offer, priority=identity.role == "operator", trailer=trailer)
            try:
                # Before the answer: the first events can come while it is still on its way.
                peer = Peer(pc, media, identity, here.console, here.settings)
                await pc.setLocalDescription(await pc.createAnswer())
            except BaseException:
                await media.close()
                raise
    except ConsoleError:
        await _discard(pc)
        raise
    except Exception as error:
        # Whatever aiortc trips over here was in the offer: it has no error of its own for that.
        await _discard(pc)
        raise BadSdp("the offer cannot be answered") from error
    except BaseException:
        await _discard(pc)
        raise
    return peer, pc.localDescription.sdp


async def _discard(pc: RTCPeerConnection) -> None:
    """Closes what negotiation may have left half made."""
    try:
        await pc.close()
    except Exception:
        log.exception("a failed negotiation could not be cleaned up")
