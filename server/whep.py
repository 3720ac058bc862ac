"""WHEP signalling (draft-ietf-wish-whep): POST an offer, PATCH candidates, DELETE to end."""

import asyncio
import gzip
import ipaddress
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Literal

from aiortc import RTCIceCandidate, RTCIceGatherer, RTCIceServer, RTCPeerConnection, RTCSessionDescription
from aiortc.sdp import SessionDescription, candidate_from_sdp, candidate_to_sdp
from fastapi import APIRouter, Depends, HTTPException, Query, Request, Response

from server.access import Identity, Right
from server.advertised import advertised_candidates, with_advertised
from server.agreed_channels import AgreedChannel, agreed_channels
from server.aiortc_servers import for_aiortc
from server.api_ice import servers_for
from server.body import read_text
from server.data_transport_private import tune_data_transport
from server.errors import (
    BadSdp,
    BadSdpFragment,
    ConsoleError,
    InternalFault,
    NotConnected,
    NotFound,
    PreconditionFailed,
    PreconditionRequired,
    RobotUnreachable,
    TooFewSections,
)
from server.ice_restart_private import IceSession
from server.ice_servers import IceServers, link_headers
from server.ice_session import LocalSession, PatchedSession
from server.media.aiortc_private import close_or_force, create_peer_connection
from server.offer import (
    MAX_SECTIONS,
    Fragment,
    FragmentCandidate,
    format_fragment,
    parse_fragment,
    prepare_offer,
)
from server.offer_sections import AnswerableOffer, answerable
from server.page import takes_coding
from server.peer_guards_private import guard_data
from server.services import Services, authorized, services
from server.to_the_end import to_the_end
from server.webrtc_peer import WebRtcPeer

__all__ = [
    "FRAGMENT",
    "NEGOTIATION_TIMEOUT",
    "SDP",
    "candidate_of",
    "patched",
    "router",
]

SDP = "application/sdp"
FRAGMENT = "application/trickle-ice-sdpfrag"
FURTHER_SECTIONS = 2  # besides one for each stream: the data channels, and the operator's voice
NEGOTIATION_TIMEOUT = 10.0  # s for all that aiortc does between offer and answer

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
    here = services(request)
    if here.console.robot.description is None:
        raise RobotUnreachable(here.console.robot.detail)
    here.guard.offer(caller.token_id)  # before it costs anything
    text = await read_text(request, SDP, here.settings.max_sdp_bytes)
    offer = answerable(prepare_offer(text, max(MAX_SECTIONS, len(here.media.offers) + FURTHER_SECTIONS)))
    channels = agreed_channels(offer.text)
    if sections == "all":
        _check_sections(here, offer)
    identity = caller.identity
    ice = servers_for(here.settings, identity)
    thumbnail = view == "thumbnail"
    if thumbnail:
        identity = identity._replace(role="observer")
    relayed = bool(relay) and not thumbnail and identity.role == "observer" and here.relays.arrived(relay)
    with here.console.peers.place(identity, relayed=relayed, thumbnail=thumbnail):
        peer, answer = await _negotiate(
            here, caller, identity, offer.text, ice, channels, trailer=stamp == "trailer", thumbnail=thumbnail
        )
        peer.relay = relay if relayed else ""
        here.console.peers.admit(peer)
    headers = {
        "Location": f"{request.scope.get('root_path', '')}/whep/{peer.resource}",
        "Accept-Patch": FRAGMENT,
        "Cache-Control": "no-store",
        "ETag": peer.ice.tag,
    }
    if ice.ice_servers:
        headers["Link"] = ", ".join(link_headers(ice))
    body = offer.answer(answer).encode()
    if takes_coding(request.headers.get("accept-encoding", ""), "gzip"):  # sections repeat each other
        body, headers = gzip.compress(body, mtime=0), headers | {"Content-Encoding": "gzip"}
    return Response(body, status_code=201, media_type=SDP, headers=headers | {"Vary": "Accept-Encoding"})


@router.options("/whep", include_in_schema=False)
async def options() -> Response:
    """What may be posted here (draft-ietf-wish-whep 4.2); a browser's preflight is answered before it comes here."""
    return Response(status_code=204, headers={"Accept-Post": SDP, "Allow": "OPTIONS, POST"})


@router.get("/whep", include_in_schema=False)
async def nothing_to_get() -> Response:
    raise HTTPException(405, "offers are posted here", {"Allow": "OPTIONS, POST"})


@router.patch("/whep/{resource}")
async def patch(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    """More candidates (RFC 8840), or an ICE restart, which says `If-Match: *` (RFC 9725 4.3.1, 4.3.3)."""
    here = services(request)
    peer = _own(here, resource, caller)
    peer.take_request()
    session = _AiortcSession(peer.pc, peer.ice, here.settings.advertise)
    return await patched(request, here, session, lambda: _own(here, resource, caller))


class _AiortcSession:
    """As `PatchedSession`, of a peer on aiortc."""

    def __init__(self, pc: RTCPeerConnection, ice: IceSession, advertise: Sequence[str]) -> None:
        self._pc = pc
        self._ice = ice
        self._advertise = advertise

    @property
    def tag(self) -> str:
        return self._ice.tag

    @property
    def username(self) -> str:
        return self._ice.username

    @property
    def connected(self) -> bool:
        return self._ice.connected

    @property
    def section(self) -> tuple[str, str]:
        first = SessionDescription.parse(self._pc.remoteDescription.sdp).media[0]
        return first.kind, first.rtp.muxId

    async def add(self, candidates: Sequence[FragmentCandidate]) -> None:
        for candidate in [candidate_of(each) for each in candidates]:
            if not await self._ice.add_candidate(candidate):
                raise BadSdpFragment("too many candidates for one session")

    async def restart(self, fragment: Fragment) -> LocalSession:
        candidates = [candidate_of(each) for each in fragment.candidates]
        local = await self._ice.restart(fragment.username, fragment.password, candidates)
        lines = [f"candidate:{candidate_to_sdp(each)}" for each in local.candidates]
        lines += [more for line in lines for more in advertised_candidates(line, self._advertise)]
        return LocalSession(local.username, local.password, lines)


async def patched(request: Request, here: Services, ice: PatchedSession, still_there: Callable[[], object]) -> Response:
    """What a PATCH does, of WHEP and of WHIP. `still_there` raises when the session has ended."""
    expected = _precondition(request, ice.tag)
    text = await read_text(request, FRAGMENT, here.settings.max_sdp_bytes)
    still_there()  # it may have ended while the body came
    kind, mid = ice.section
    fragment = parse_fragment(text, mid)
    if fragment.username in ("", ice.username):
        await ice.add(fragment.candidates)
        return Response(status_code=204)
    if expected != "*" or not fragment.password:
        raise BadSdpFragment("another ice-ufrag: a restart says If-Match: * and has an ice-pwd")
    if not ice.connected:
        raise NotConnected("there is no ICE session that could be restarted")
    try:
        async with asyncio.timeout(NEGOTIATION_TIMEOUT):
            local = await ice.restart(fragment)
    except (TimeoutError, ConnectionError) as error:
        raise NotConnected("the ICE session ended, or gathered nothing in time") from error
    body = format_fragment(local.username, local.password, kind, mid, local.candidates)
    headers = {"ETag": ice.tag, "Cache-Control": "no-store"}
    return Response(body, status_code=200, media_type=FRAGMENT, headers=headers)


def _precondition(request: Request, tag: str) -> str:
    """What the request expects of the ICE session: `*` (any), or its tag (RFC 9110 13.1.1)."""
    expected = request.headers.get("if-match", "").strip()
    if not expected:
        raise PreconditionRequired("a PATCH needs If-Match: the ETag of the ICE session, or * to restart it")
    if expected != "*" and tag not in [each.strip() for each in expected.split(",")]:
        raise PreconditionFailed("that is not the newest ICE session")
    return expected


def candidate_of(each: FragmentCandidate) -> RTCIceCandidate:
    """Raises BadSdpFragment when it cannot be used."""
    try:
        candidate = candidate_from_sdp(each.line.removeprefix("candidate:"))
        ipaddress.ip_address(candidate.ip)
    except Exception as error:
        # aiortc's parser has no error of its own.
        raise BadSdpFragment("a candidate that is not valid") from error
    candidate.sdpMid = each.mid
    return candidate


@router.delete("/whep/{resource}")
async def delete(resource: str, request: Request, caller: Annotated[Right, Depends(authorized)]) -> Response:
    _own(services(request), resource, caller).end("deleted")
    return Response(status_code=200)


def _own(here: Services, resource: str, caller: Right) -> WebRtcPeer:
    """The peer of this resource; somebody else's is as good as none."""
    peer = here.console.peers.by_resource(resource)
    if peer.identity.token_id != caller.token_id:
        raise NotFound("no such WHEP resource")
    return peer


def _check_sections(here: Services, offer: AnswerableOffer) -> None:
    kinds = Counter(stream.kind for stream in here.media.offers)
    if any(offer.receives(kind) < count for kind, count in kinds.items()):
        raise TooFewSections(f"{kinds['video']} of video and {kinds['audio']} of audio are needed for all streams")


async def _negotiate(
    here: Services,
    caller: Right,
    identity: Identity,
    offer: str,
    ice: IceServers,
    channels: Sequence[AgreedChannel],
    *,
    trailer: bool,
    thumbnail: bool,
) -> tuple[WebRtcPeer, str]:
    """`identity`: as whom `caller` takes part."""
    # No STUN server unless asked for: our host candidates are a setting, the peer's address is learnt from its checks.
    own_servers = for_aiortc(ice) if here.settings.relay_console else []
    pc = create_peer_connection(own_servers)
    try:
        async with asyncio.timeout(NEGOTIATION_TIMEOUT):
            with offers_fault():
                await pc.setRemoteDescription(RTCSessionDescription(offer, "offer"))
            peer = await _answering_peer(here, identity, offer, pc, own_servers, trailer=trailer, thumbnail=thumbnail)
            peer.agree_on(channels)
            try:
                caller.identity  # noqa: B018  raises when the link has ended meanwhile
            except ConsoleError:
                await peer.abandon()
                raise
    except BaseException as error:
        await discard(here, pc)
        if isinstance(error, TimeoutError):
            raise BadSdp("the offer cannot be answered in time") from error
        if isinstance(error, Exception) and not isinstance(error, ConsoleError):
            here.metrics.faults.caught("peer offer", error)
            raise InternalFault("the console could not answer; it has written down why") from error
        raise
    return peer, with_advertised(pc.localDescription.sdp, here.settings.advertise)


async def _answering_peer(
    here: Services,
    identity: Identity,
    offer: str,
    pc: RTCPeerConnection,
    own_servers: list[RTCIceServer],
    *,
    trailer: bool,
    thumbnail: bool,
) -> WebRtcPeer:
    """The peer behind `pc`, which has the answer when this returns."""
    tune_data_transport(pc, observes=identity.role == "observer")
    line = here.voice.line(identity.role)
    media = here.media.attach(
        pc,
        offer,
        priority=identity.role == "operator",
        waits=identity.role == "observer",
        trailer=trailer,
        thumbnail=thumbnail,
        voice=None if line is None else line.take,
    )
    try:
        # Before the answer: the first events can come while it is still on its way.
        refused = here.metrics.bad_input.labels
        session = IceSession(
            pc,
            offered_username(offer),
            lambda: RTCIceGatherer(own_servers),
            here.settings.peer_connect_timeout,
            lambda name: refused("transport", name).inc(),
        )
        peer = WebRtcPeer(pc, media, session, identity, here.console, here.settings)
        peer.thumbnail = thumbnail
        if line is not None:
            line.peer = peer
        guard_data(pc, peer.transport_refused)
        with offers_fault():
            await to_the_end(pc.setLocalDescription(await pc.createAnswer()))
    except BaseException:
        await media.close()
        raise
    return peer


@contextmanager
def offers_fault() -> Iterator[None]:
    """Whatever aiortc trips over here was in the offer: it has no error of its own for that."""
    try:
        yield
    except Exception as error:
        raise BadSdp("the offer cannot be answered") from error


def offered_username(offer: str) -> str:
    """The peer's ice-ufrag: that of the first section, with which all others are bundled."""
    first = SessionDescription.parse(offer).media[0].ice
    return "" if first is None else first.usernameFragment or ""


async def discard(here: Services, pc: RTCPeerConnection) -> None:
    """Closes what negotiation may have left half made."""
    try:
        await close_or_force(pc)
    except Exception as error:
        here.metrics.faults.caught("offer", error, what="a failed negotiation could not be cleaned up")
