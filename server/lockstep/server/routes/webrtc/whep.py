"""WHEP signalling (draft-ietf-wish-whep): POST an offer, PATCH candidates, DELETE to end."""

import gzip
from collections import Counter
from collections.abc import Callable
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, HTTPException, Query, Request, Response

from lockstep.rtc.peer import PeerSettings
from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sdp import SessionDescription, write_description, write_fragment
from lockstep.server.auth.tokens import Identity, Right
from lockstep.server.errors import (
    BadSdpFragment,
    NotConnected,
    NotFound,
    PreconditionFailed,
    PreconditionRequired,
    RobotUnreachable,
    ShuttingDown,
    TooFewSections,
)
from lockstep.server.http.request_body import read_text
from lockstep.server.http.static_files import takes_coding
from lockstep.server.peers.agreed_channels import agreed_channels
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.webrtc_transport import WebRtcTransport
from lockstep.server.routes.webrtc.ice import servers_for
from lockstep.server.routes.webrtc.negotiation import FRAGMENT, SDP, created_headers, negotiated, own_servers
from lockstep.server.state.dependencies import Dependencies, authorized, dependencies
from lockstep.server.webrtc.ice_session import IceSession
from lockstep.server.webrtc.sdp_offer import MAX_SECTIONS, parse_fragment, parse_offer

__all__ = ["patched", "router"]

FURTHER_SECTIONS = 2  # besides one for each stream: the data channels, and the operator's voice

# The welcome has the robot's description, which is longer than 16 KiB for an arm with many bodies.
LARGEST_MESSAGE = 64 * 1024  # bytes; every browser takes that
OF_OBSERVERS = PeerSettings(sctp=SctpSettings(max_send_message=LARGEST_MESSAGE))
# Drivers get acknowledgements soon, with the feedback in most cases: no repeat waits for them.
OF_DRIVERS = PeerSettings(sctp=SctpSettings(max_send_message=LARGEST_MESSAGE, acknowledgement_delay=0.01))

router = APIRouter()


@router.post("/whep")
async def create(
    request: Request,
    caller: Annotated[Right, Depends(authorized)],
    stamp: Literal["trailer"] | None = None,
    relay: Annotated[str, Query(pattern=r"^\d{0,3}$")] = "",
    view: Literal["thumbnail"] | None = None,
    sections: Literal["all"] | None = None,
) -> Response:
    """An offer in, an answer out; the peer lives on until DELETE, or until its connection ends.

    `relay`: an observer has its media from that relay, and offers data channels alone.
    `view`: a thumbnail is a small picture of the main camera on an overview, and takes part in nothing, whatever the
    role of who asks.
    `sections`: an offer with fewer media sections than there are streams is refused, for the peer to make a larger one.
    """
    here = dependencies(request)
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    here.request_limits.offer(caller.token_id)  # before it costs anything
    text = await read_text(request, SDP, here.settings.max_sdp_bytes)
    offer = parse_offer(text, max(MAX_SECTIONS, len(here.media.offers) + FURTHER_SECTIONS))
    if sections == "all":
        _check_sections(here, offer)
    identity = caller.identity
    ice = servers_for(here.settings, identity)
    thumbnail = view == "thumbnail"
    if thumbnail:
        identity = identity._replace(role="observer")
    relayed = bool(relay) and not thumbnail and identity.role == "observer" and here.relays.arrived(relay)
    with here.console.peers.places.keep(identity, relayed=relayed, thumbnail=thumbnail):
        trailer = stamp == "trailer"
        peer, transport, answer = await _negotiate(here, caller, identity, offer, trailer=trailer, thumbnail=thumbnail)
        peer.relay = relay if relayed else ""
        try:
            here.console.peers.admit(peer)
        except ShuttingDown:
            await peer.close()
            raise
    headers = created_headers(request, f"/whep/{transport.resource}", transport.ice.tag, ice)
    body = write_description(answer).encode()
    if takes_coding(request.headers.get("accept-encoding", ""), "gzip"):  # sections repeat each other
        body, headers = gzip.compress(body, mtime=0), headers | {"Content-Encoding": "gzip"}
    return Response(body, status_code=201, media_type=SDP, headers=headers | {"Vary": "Accept-Encoding"})


@router.options("/whep", include_in_schema=False)
async def options() -> Response:
    """Name the type to post (draft-ietf-wish-whep 4.2); a browser's preflight is answered before it comes here."""
    return Response(status_code=204, headers={"Accept-Post": SDP, "Allow": "OPTIONS, POST"})


@router.api_route("/whep", methods=["GET", "HEAD", "PUT", "PATCH", "DELETE"], include_in_schema=False)
async def nothing_to_get() -> Response:
    raise HTTPException(405, "send an offer to this URL by POST", {"Allow": "OPTIONS, POST"})


@router.patch("/whep/{resource}")
async def patch(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    """More candidates (RFC 8840), or an ICE restart, which says `If-Match: *` (RFC 9725 4.3.1, 4.3.3)."""
    here = dependencies(request)
    _, transport = _own(here, resource, caller)
    transport.take_request()
    return await patched(request, here, transport.ice, lambda: _own(here, resource, caller))


async def patched(request: Request, here: Dependencies, ice: IceSession, still_there: Callable[[], object]) -> Response:
    """Handle a PATCH of WHEP or WHIP. `still_there` raises when the session has ended."""
    expected = _precondition(request, ice.tag)
    text = await read_text(request, FRAGMENT, here.settings.max_sdp_bytes)
    still_there()  # it may have ended while the body came
    kind, mid = ice.section
    fragment = parse_fragment(text, mid)
    if fragment.ufrag in ("", ice.username):
        ice.add(fragment.candidates)
        return Response(status_code=204)
    if expected != "*" or not fragment.password:
        raise BadSdpFragment("the ice-ufrag differs: a restart needs If-Match: * and an ice-pwd")
    if not ice.connected:
        raise NotConnected("there is no ICE session that could be restarted")
    body = write_fragment(ice.restart(fragment), kind, mid)
    headers = {"ETag": ice.tag, "Cache-Control": "no-store"}
    return Response(body, status_code=200, media_type=FRAGMENT, headers=headers)


def _precondition(request: Request, tag: str) -> str:
    """Return the request's precondition on the ICE session: `*` (any), or its tag (RFC 9110 13.1.1)."""
    expected = request.headers.get("if-match", "").strip()
    if not expected:
        raise PreconditionRequired("a PATCH needs If-Match: the ETag of the ICE session, or * to restart it")
    if expected != "*" and tag not in [each.strip() for each in expected.split(",")]:
        raise PreconditionFailed("the If-Match header does not name the newest ICE session")
    return expected


@router.delete("/whep/{resource}")
async def delete(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    peer, _ = _own(dependencies(request), resource, caller)
    peer.end("deleted")
    return Response(status_code=200)


def _own(here: Dependencies, resource: str, caller: Right) -> tuple[Peer, WebRtcTransport]:
    """Return the caller's peer of this resource. Raises NotFound, also for the resource of somebody else."""
    peer, transport = here.console.peers.by_resource(resource)
    if peer.identity.token_id != caller.token_id:
        raise NotFound("no such WHEP resource")
    return peer, transport


def _check_sections(here: Dependencies, offer: SessionDescription) -> None:
    kinds = Counter(stream.kind for stream in here.media.offers)
    wanted = Counter(each.kind for each in offer.accepted if each.direction in ("recvonly", "sendrecv"))
    if any(wanted[kind] < count for kind, count in kinds.items()):
        raise TooFewSections(f"all streams need {kinds['video']} video and {kinds['audio']} audio sections")


async def _negotiate(
    here: Dependencies, caller: Right, identity: Identity, offer: SessionDescription, *, trailer: bool, thumbnail: bool
) -> tuple[Peer, WebRtcTransport, SessionDescription]:
    """Return the peer, its transport and its answer. `identity`: the one under which `caller` takes part."""
    channels = agreed_channels([each for section in offer.accepted for each in section.channel_maps])
    observes = identity.role == "observer"
    turns = here.media.datagrams.create(waits=observes)
    opening = here.context.endpoint.connect(
        turns=turns, servers=own_servers(here, identity), settings=OF_OBSERVERS if observes else OF_DRIVERS
    )
    async with negotiated(here, opening, "peer offer") as connection:
        line = here.voice.line(identity.role)
        plan = here.media.plan(offer, trailer=trailer, thumbnail=thumbnail, voice=line is not None)
        answer = connection.answer(offer, plan.media)
        media = here.media.subscribers.attach(connection, plan, priority=identity.role == "operator", turns=turns)
        ice = IceSession(connection, offer.transport.ufrag)
        transport = WebRtcTransport(connection, media, ice, take_voice=None if line is None else line.take)
        peer = Peer(transport, media, identity, here.console, here.settings)
        peer.thumbnail = thumbnail
        if line is not None:
            line.peer = peer
        try:
            transport.agree_on(channels)
            caller.identity  # noqa: B018  raises when the link has ended meanwhile
        except BaseException:
            await peer.close()
            raise
        connection.listen(transport.heard)
    return peer, transport, answer
