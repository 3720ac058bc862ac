"""WHIP signalling (RFC 9725): a client with an operator's link publishes one of the console's own cameras."""

from dataclasses import replace
from typing import Annotated, cast

from fastapi import APIRouter, Depends, HTTPException, Query, Request, Response

from lockstep.protocol.console import PEOPLE
from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia, MediaSection, SessionDescription, write_description
from lockstep.rtc.sdp.codecs import common_codecs, is_same_format
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import (
    BadSdp,
    NotAcceptable,
    NotAllowed,
    NotFound,
    RobotUnreachable,
    ShuttingDown,
)
from lockstep.server.http.request_body import read_text
from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.media.published.published_camera import PublishedCamera
from lockstep.server.publishing.publisher import Publisher
from lockstep.server.routes.webrtc.ice import servers_for
from lockstep.server.routes.webrtc.negotiation import FRAGMENT, SDP, created_headers, negotiated, own_servers
from lockstep.server.routes.webrtc.whep import patched
from lockstep.server.state.dependencies import Dependencies, authorized, dependencies
from lockstep.server.webrtc.sdp_offer import parse_offer

__all__ = ["router"]

FEEDBACK = ("nack", "nack pli", "goog-remb")
H264 = {"packetization-mode": "1", "level-asymmetry-allowed": "1"}
PROFILES = ("42001f", "42e01f", "4d001f", "64001f", "640c1f")  # baseline, main and high; all of them can be decoded
PICTURES = (
    Codec(96, "VP8", 90_000, feedback=FEEDBACK),
    Codec(97, "rtx", 90_000, parameters={"apt": "96"}),
    *(
        Codec(number, "H264", 90_000, parameters=H264 | {"profile-level-id": profile}, feedback=FEEDBACK)
        for number, profile in enumerate(PROFILES, 98)
    ),
)
SOUND = (Codec(111, "opus", 48_000, 2), Codec(0, "PCMU", 8000), Codec(8, "PCMA", 8000))

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
    if caller.identity.role not in PEOPLE:
        raise NotAllowed("observers and policies may not publish")
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    here.request_limits.offer(caller.token_id)  # before it costs anything
    text = await read_text(request, SDP, here.settings.max_sdp_bytes)
    offer = _parsed(text)
    section = _pictures(offer)
    ice = servers_for(here.settings, caller.identity)
    with here.publishers.place(caller.identity, camera) as wanted:
        publisher, answer = await _negotiate(here, caller, offer, section, wanted)
        try:
            here.publishers.admit(publisher)
        except ShuttingDown:
            publisher.close()
            raise
    headers = created_headers(request, f"/whip/{publisher.resource}", publisher.ice.tag, ice)
    return Response(answer, status_code=201, media_type=SDP, headers=headers)


@router.options("/whip", include_in_schema=False)
async def options(request: Request) -> Response:
    """Name what may be posted here (RFC 9725 4.2); a browser's preflight is answered before it comes here."""
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
    raise HTTPException(405, "send an offer to this URL by POST", {"Allow": ENDPOINT_METHODS})


@router.api_route("/whip/{resource}", methods=["GET", "HEAD", "PUT", "POST"], include_in_schema=False)
async def nothing_of_a_session(resource: str, request: Request) -> Response:
    _enabled(request)
    raise HTTPException(405, "a WHIP session takes PATCH and DELETE only", {"Allow": SESSION_METHODS})


@router.patch("/whip/{resource}")
async def patch(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    """More candidates, or an ICE restart, which says `If-Match: *` (RFC 9725 4.3.1, 4.3.3)."""
    here = _enabled(request)
    publisher = _own(here, resource, caller)
    publisher.take_request()
    return await patched(request, here, publisher.ice, lambda: _own(here, resource, caller))


@router.delete("/whip/{resource}")
async def delete(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    here = _enabled(request)
    here.publishers.end(_own(here, resource, caller), "deleted")
    return Response(status_code=200)


def _parsed(text: str) -> SessionDescription:
    offer = parse_offer(text)
    if any(section.sctp_port is not None for section in offer.sections):
        raise BadSdp("a publisher may not offer data channels")
    return offer


def _pictures(offer: SessionDescription) -> MediaSection:
    """Return the first section that sends usable pictures, with its preferred codec and the codec of its repairs."""
    for section in offer.sections:
        if section.kind == "video" and section.direction in ("sendonly", "sendrecv"):
            common = {each.payload_type for each in common_codecs(section.codecs, PICTURES)}
            best = next((each for each in section.codecs if each.payload_type in common and each.repairs is None), None)
            if best is not None:
                repair = section.repair_of(best)
                return replace(section, codecs=(best,) if repair is None else (best, repair))
    raise NotAcceptable("the offer has no section that sends pictures in H.264 or VP8")


def _enabled(request: Request) -> Dependencies:
    """Return the dependencies. Raises NotFound where nobody may publish anything."""
    here = dependencies(request)
    if not here.publishers.enabled:
        raise NotFound("nothing can be published to this console: LOCKSTEP_WHIP names no camera")
    return here


def _own(here: Dependencies, resource: str, caller: Right) -> Publisher:
    """Return the caller's publisher of this session. Raises NotFound, also for the session of somebody else."""
    publisher = here.publishers.by_resource(resource)
    if publisher.identity.token_id != caller.token_id:
        raise NotFound("no such WHIP session")
    return publisher


async def _negotiate(
    here: Dependencies, caller: Right, offer: SessionDescription, section: MediaSection, camera: PublishedCamera
) -> tuple[Publisher, str]:
    """Return the publisher, and its answer. `section`: its pictures are taken; others are answered inactive."""
    publisher = Publisher(camera, caller.identity, here.settings)
    opening = here.context.endpoint.connect(
        publisher.heard, turns=here.media.datagrams.observers, servers=own_servers(here, caller.identity)
    )
    async with negotiated(here, opening, "publisher offer") as connection:
        answer = connection.answer(offer, {each.mid: _answered(each, section) for each in offer.sections})
        codec = "VP8" if section.codecs[0].name.lower() == "vp8" else "H264"
        publisher.receives(connection, offer.transport.ufrag, section.mid, cast(PictureCodec, codec))
        caller.identity  # noqa: B018  raises when the link has ended meanwhile
    return publisher, write_description(answer)


def _answered(offered: MediaSection, taken: MediaSection) -> LocalMedia:
    if offered.mid != taken.mid:
        return LocalMedia(PICTURES if offered.kind == "video" else SOUND, "inactive")
    known = [each for each in PICTURES if each.repairs is not None or is_same_format(each, taken.codecs[0])]
    return LocalMedia(known, "recvonly", (MID_URI,))
