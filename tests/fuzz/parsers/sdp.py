"""What WHEP must withstand, as one function of bytes: offers, fragments, and the answer to an accepted offer.

The first byte chooses. Whatever the rest is: only the documented errors come out, and what is accepted keeps the
bounds.
"""

import functools
import random

from OpenSSL import SSL

from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import dtls_context
from lockstep.rtc.peer import Peer
from lockstep.rtc.sdp import (
    LocalMedia,
    SdpError,
    SessionDescription,
    parse_description,
    write_description,
    write_fragment,
)
from lockstep.server.errors import BadSdp, BadSdpFragment
from lockstep.server.media.codecs.codec_choice import known_codecs
from lockstep.server.peers.agreed_channels import agreed_channels
from lockstep.server.webrtc.sdp_offer import MAX_CANDIDATES, MAX_SECTIONS, parse_fragment, parse_offer

__all__ = ["try_input"]


def offer(text: str) -> SessionDescription | None:
    """What is accepted says the same when it is written and read again."""
    try:
        found = parse_offer(text)
        agreed_channels([each for section in found.sections for each in section.channel_maps])
    except BadSdp:
        return None
    if len(found.sections) > MAX_SECTIONS:
        raise AssertionError("more sections than the bound")
    again = parse_description(write_description(found))
    if [each.mid for each in again.sections] != [each.mid for each in found.sections]:
        raise AssertionError("an accepted offer changes when it is written and read again")
    return found


def fragment(text: str) -> None:
    try:
        found = parse_fragment(text, "0")
    except BadSdpFragment:
        return
    if len(found.candidates) > MAX_CANDIDATES:
        raise AssertionError("more candidates than the bound")
    if found.ufrag and found.password:
        again = parse_fragment(write_fragment(found, "video", "0"), "0")
        if (again.ufrag, again.password) != (found.ufrag, found.password):
            raise AssertionError("credentials change on their way")


def negotiation(text: str) -> None:
    """An accepted offer has an answer, or is refused by name; the peer lives on either way."""
    accepted = offer(text)
    if accepted is None:
        return
    certificate, context = _identity()
    peer = Peer(context, certificate.fingerprint, [], controlling=False, random=random.Random(1))
    media = {each.mid: LocalMedia(known_codecs(each.kind), "sendonly") for each in accepted.sections if each.is_media}
    try:
        answer = peer.answer(accepted, media, 0.0)
    except SdpError:
        return
    if len(answer.sections) != len(accepted.sections):
        raise AssertionError("an answer has a section for each of the offer's (RFC 3264 6)")
    peer.handle_timer(1.0)
    peer.close(2.0)


@functools.cache
def _identity() -> tuple[Certificate, SSL.Context]:
    certificate = Certificate.generate()
    return certificate, dtls_context(certificate)


SCENES = (offer, fragment, negotiation)


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    code = data[0] if data else 0
    SCENES[code % len(SCENES)](data[1:].decode(errors="replace"))
