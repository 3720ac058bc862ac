"""What WHEP must withstand, as one function of bytes: offers, fragments, and what aiortc makes of an accepted offer.

The first byte chooses. Whatever the rest is: only the documented errors come out, and what is accepted keeps the
bounds.
"""

import asyncio
import atexit
import contextlib
import functools

from aiortc import RTCSessionDescription

from server.data_transport_private import tune_data_transport
from server.errors import BadSdp, BadSdpFragment
from server.media.aiortc_private import create_peer_connection, offered_extensions, restrict_ice_hosts
from server.offer import MAX_CANDIDATES, MAX_SECTIONS, format_fragment, parse_fragment, prepare_offer
from server.whep import candidate_of

__all__ = ["try_input"]

SECONDS = 5.0  # that aiortc gets; it has no sockets to wait for here


def offer(text: str) -> str | None:
    """What is accepted is still accepted when it is read again, and unchanged."""
    try:
        prepared = prepare_offer(text)
    except BadSdp:
        return None
    if prepare_offer(prepared) != prepared:
        raise AssertionError("an accepted offer changes when it is read again")
    if len(offered_extensions(prepared)) > MAX_SECTIONS:
        raise AssertionError("more sections than the bound")
    if ".local " in "".join(line for line in prepared.splitlines() if line.startswith("a=candidate:")):
        raise AssertionError("an mDNS name was left in")
    return prepared


def fragment(text: str) -> None:
    try:
        found = parse_fragment(text, "0")
        for each in found.candidates:
            candidate_of(each)
    except BadSdpFragment:
        return
    if len(found.candidates) > MAX_CANDIDATES:
        raise AssertionError("more candidates than the bound")
    if found.username and found.password:
        again = parse_fragment(format_fragment(found.username, found.password, "video", "0", []), "")
        if again[:2] != found[:2]:
            raise AssertionError("credentials change on their way")


def negotiation(text: str) -> None:
    """aiortc may refuse an accepted offer in its own way; it must neither hang nor end the process."""
    prepared = offer(text)
    if prepared is not None:
        _runner().run(_answer(prepared))


@functools.cache
def _runner() -> asyncio.Runner:
    restrict_ice_hosts([])  # no sockets
    runner = asyncio.Runner()
    atexit.register(runner.close)
    return runner


async def _answer(text: str) -> None:
    pc = create_peer_connection()
    try:
        async with asyncio.timeout(SECONDS):
            # `server/whep.py` catches whatever aiortc trips over, and says bad_sdp.
            with contextlib.suppress(Exception):
                await pc.setRemoteDescription(RTCSessionDescription(text, "offer"))
                tune_data_transport(pc)
                await pc.setLocalDescription(await pc.createAnswer())
    finally:
        await pc.close()


SCENES = (offer, fragment, negotiation)


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    code = data[0] if data else 0
    SCENES[code % len(SCENES)](data[1:].decode(errors="replace"))
