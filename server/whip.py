"""WHIP signalling (RFC 9725): somebody with an operator's link publishes a camera of the console's own."""

import asyncio
import time
from typing import Annotated

from aiortc import RTCIceGatherer, RTCIceServer, RTCPeerConnection, RTCSessionDescription
from fastapi import APIRouter, Depends, HTTPException, Query, Request, Response

from server.access import Right
from server.advertised import with_advertised
from server.aiortc_servers import for_aiortc
from server.api_ice import servers_for
from server.body import read_text
from server.errors import (
    BadSdp,
    ConsoleError,
    InternalFault,
    NotAcceptable,
    NotAllowed,
    NotFound,
    RobotUnreachable,
)
from server.ice_restart_private import IceSession
from server.ice_servers import link_headers
from server.media.aiortc_private import create_peer_connection, offered_direction
from server.media.published.published_camera import PublishedCamera
from server.media.published.receiver_private import take_pictures
from server.offer import MAX_SECTIONS, prepare_offer
from server.offer_sections import AnswerableOffer, answerable
from server.publisher import Publisher
from server.services import Services, authorized, services
from server.to_the_end import to_the_end
from server.whep import FRAGMENT, NEGOTIATION_TIMEOUT, SDP, discard, offered_username, offers_fault, patched

__all__ = ["router"]

ENDPOINT_METHODS, SESSION_METHODS = "OPTIONS, POST", "DELETE, OPTIONS, PATCH"

router = APIRouter()


@router.post("/whip")
async def create(
    request: Request,
    caller: Annotated[Right, Depends(authorized)],
    camera: Annotated[str, Query(max_length=32)] = "",
) -> Response:
    """An offer in, an answer out; the publication lives on until DELETE, or until its connection or its link ends.

    `camera`: its name; "" is the first that nobody publishes.
    """
    here = _enabled(request)
    if caller.identity.role == "observer":
        raise NotAllowed("observers publish nothing")
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    here.guard.offer(caller.token_id)  # before it costs anything
    text = await read_text(request, SDP, here.settings.max_sdp_bytes)
    offer = _answerable(prepare_offer(text, MAX_SECTIONS))
    ice = servers_for(here.settings, caller.identity)
    with here.publishers.place(caller.identity, camera) as wanted:
        publisher, answer = await _negotiate(here, caller, offer.text, wanted)
        here.publishers.admit(publisher)
    headers = {
        "Location": f"{request.scope.get('root_path', '')}/whip/{publisher.resource}",
        "Accept-Patch": FRAGMENT,
        "Cache-Control": "no-store",
        "ETag": publisher.ice.tag,
    }
    if ice.ice_servers:
        headers["Link"] = ", ".join(link_headers(ice))
    return Response(offer.answer(answer), status_code=201, media_type=SDP, headers=headers)


@router.options("/whip", include_in_schema=False)
async def options(request: Request) -> Response:
    """What may be posted here (RFC 9725 4.2); a browser's preflight is answered before it comes here."""
    _enabled(request)
    return Response(status_code=204, headers={"Accept-Post": SDP, "Allow": ENDPOINT_METHODS})


@router.options("/whip/{resource}", include_in_schema=False)
async def session_options(resource: str, request: Request) -> Response:
    """The same for every resource: nobody learns which there are."""
    _enabled(request)
    return Response(status_code=204, headers={"Accept-Patch": FRAGMENT, "Allow": SESSION_METHODS})


@router.api_route("/whip", methods=["GET", "HEAD", "PUT", "PATCH", "DELETE"], include_in_schema=False)
async def nothing_to_get(request: Request) -> Response:
    _enabled(request)
    raise HTTPException(405, "offers are posted here", {"Allow": ENDPOINT_METHODS})


@router.api_route("/whip/{resource}", methods=["GET", "HEAD", "PUT", "POST"], include_in_schema=False)
async def nothing_of_a_session(resource: str, request: Request) -> Response:
    _enabled(request)
    raise HTTPException(405, "a WHIP session is patched and deleted", {"Allow": SESSION_METHODS})


@router.patch("/whip/{resource}")
async def patch(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    """More candidates, or an ICE restart, which says `If-Match: *` (RFC 9725 4.3.1, 4.3.3)."""
    here = _enabled(request)
    publisher = _own(here, resource, caller)
    publisher.take_request()
    return await patched(request, here, publisher.pc, publisher.ice, lambda: _own(here, resource, caller))


@router.delete("/whip/{resource}")
async def delete(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    here = _enabled(request)
    here.publishers.end(_own(here, resource, caller), "deleted")
    return Response(status_code=200)


def _answerable(text: str) -> AnswerableOffer:
    if "\nm=application" in text:
        raise BadSdp("a publisher has no data channels")
    try:
        return answerable(text)
    except BadSdp as error:
        raise NotAcceptable(error.detail) from error


def _enabled(request: Request) -> Services:
    """Raises NotFound where nobody may publish anything."""
    here = services(request)
    if not here.publishers.enabled:
        raise NotFound("nothing can be published to this console: LOCKSTEP_WHIP names no camera")
    return here


def _own(here: Services, resource: str, caller: Right) -> Publisher:
    """The publisher of this session; somebody else's is as good as none."""
    publisher = here.publishers.by_resource(resource)
    if publisher.identity.token_id != caller.token_id:
        raise NotFound("no such WHIP session")
    return publisher


async def _negotiate(here: Services, caller: Right, offer: str, camera: PublishedCamera) -> tuple[Publisher, str]:
    own_servers = for_aiortc(servers_for(here.settings, caller.identity)) if here.settings.relay_console else []
    pc = create_peer_connection(own_servers)
    try:
        async with asyncio.timeout(NEGOTIATION_TIMEOUT):
            with offers_fault():
                await pc.setRemoteDescription(RTCSessionDescription(offer, "offer"))
            publisher = _publisher(here, caller, offer, pc, own_servers, camera)
            with offers_fault():
                await to_the_end(pc.setLocalDescription(await pc.createAnswer()))
        caller.identity  # noqa: B018  raises when the link has ended meanwhile
    except BaseException as error:
        await discard(here, pc)
        if isinstance(error, TimeoutError):
            raise BadSdp("the offer cannot be answered in time") from error
        if isinstance(error, Exception) and not isinstance(error, ConsoleError):
            here.metrics.faults.caught("publisher offer", error)
            raise InternalFault("the console could not answer; it has written down why") from error
        raise
    return publisher, with_advertised(pc.localDescription.sdp, here.settings.advertise)


def _publisher(
    here: Services,
    caller: Right,
    offer: str,
    pc: RTCPeerConnection,
    own_servers: list[RTCIceServer],
    camera: PublishedCamera,
) -> Publisher:
    """The publisher behind `pc`: its first section of pictures is taken, all others are answered inactive."""
    here.media.guard_publisher(pc)
    publisher = Publisher(pc, camera, caller.identity, here.settings)
    section = None
    for transceiver in pc.getTransceivers():
        transceiver.direction = "inactive"
        sends = offered_direction(transceiver) in ("recvonly", "sendrecv")  # as seen from here
        if section is None and transceiver.kind == "video" and sends:
            section = take_pictures(transceiver, publisher.packet, time.monotonic)
    if section is None:
        raise NotAcceptable("no section that sends pictures in H.264 or VP8")
    publisher.receives(section)
    refused = here.metrics.bad_input.labels
    publisher.ice = IceSession(
        pc,
        offered_username(offer),
        lambda: RTCIceGatherer(own_servers),
        here.settings.peer_connect_timeout,
        lambda name: refused("transport", name).inc(),
        publisher.round_trip,
    )
    publisher.ice.on_expired = lambda: publisher.end("consent expired")
    return publisher
