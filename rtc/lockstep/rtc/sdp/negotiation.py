"""Offer and answer (RFC 3264, RFC 8829 5) for one BUNDLE."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from lockstep.rtc.sdp.codecs import common_codecs, is_same_format
from lockstep.rtc.sdp.description import (
    LARGEST_EXTENSION_ID,
    Codec,
    Direction,
    HeaderExtension,
    MediaSection,
    SessionDescription,
    Setup,
    Source,
    SourceGroup,
    Transport,
    both,
    rejection_of,
    reverse,
)
from lockstep.rtc.sdp.errors import SdpError

__all__ = ["LocalMedia", "answer_to", "check_answer", "data_section", "media_section", "offer_of"]

MAX_REASON = 500  # characters
RESERVED_ID = 15  # of header extensions; ends the list in the one-byte form (RFC 8285 4.2), so it is never chosen


@dataclass(frozen=True, slots=True)
class LocalMedia:
    """The abilities of this side in one media section."""

    codecs: Sequence[Codec]  # the preferred one first; with "rtx" among them, retransmission as well
    direction: Direction = "sendrecv"
    extensions: Sequence[str] = ()  # URIs
    msid: str = ""  # "stream track", of the outgoing stream
    sources: tuple[Source, ...] = ()  # of the outgoing stream
    source_groups: tuple[SourceGroup, ...] = ()


# Answering


def answer_to(
    offer: SessionDescription,
    transport: Transport,
    media: Mapping[str, LocalMedia],
    *,
    data: bool = True,
    max_message_size: int | None = None,
    session_id: int = 0,
    version: int = 1,
) -> SessionDescription:
    """Return the answer. Sections without a local counterpart or a common codec are rejected (RFC 3264 6).

    Args:
        transport: that of this side; its `setup` is the role where the offer leaves the choice (RFC 8842 5.3)
        media: the abilities of this side, by mid
        data: True if this side takes data channels
        max_message_size: bytes of one message that this side takes; None: 65536

    Raises:
        SdpError: no section can be answered, or its extensions are more than there are ids.
    """
    chosen = _chosen_ids(offer)
    sections = [
        _answered(section, media.get(section.mid), chosen, data, max_message_size) for section in offer.sections
    ]
    if all(section.rejected for section in sections):
        raise SdpError("; ".join(f"section {each.mid}: no codec in common" for each in sections)[:MAX_REASON])
    return SessionDescription(
        transport=replace(transport, setup=_own_setup(offer.transport.setup, transport.setup)),
        sections=tuple(sections),
        session_id=session_id,
        version=version,
        allow_mixed=offer.allow_mixed,
    )


def _own_setup(offered: Setup, preferred: Setup) -> Setup:
    """Return the DTLS role of this side (RFC 8842 5.3)."""
    if offered == "actpass":
        return "active" if preferred == "active" else "passive"
    return "passive" if offered == "active" else "active"


def _answered(
    offered: MediaSection, own: LocalMedia | None, chosen: Mapping[str, int], data: bool, max_message_size: int | None
) -> MediaSection:
    if offered.rejected:
        return offered
    if offered.sctp_port is not None and data:
        return replace(offered, max_message_size=max_message_size)
    codecs = common_codecs(offered.codecs, own.codecs) if own is not None else ()
    if own is None or not codecs:
        return rejection_of(offered.kind, offered.mid, offered.protocol, offered.formats)
    direction = both(reverse(offered.direction), own.direction)
    sends = direction in ("sendrecv", "sendonly")
    own = own if any(codec.repairs is not None for codec in codecs) else _without_repair(own)
    return MediaSection(
        kind=offered.kind,
        mid=offered.mid,
        protocol=offered.protocol,
        direction=direction,
        codecs=codecs,
        extensions=tuple(_agreed_extensions(offered, own, chosen)),
        sources=own.sources if sends else (),
        source_groups=own.source_groups if sends else (),
        msid=own.msid if sends else "",
        reduced_size=offered.reduced_size,
    )


def _without_repair(own: LocalMedia) -> LocalMedia:
    """Return `own` without its repair streams, which are not announced where RFC 4588 is not in use."""
    groups = [group for group in own.source_groups if group.semantics == "FID"]
    repairs = {ssrc for group in groups for ssrc in group.ssrcs[1:]}
    return replace(
        own,
        sources=tuple(source for source in own.sources if source.ssrc not in repairs),
        source_groups=tuple(group for group in own.source_groups if group not in groups),
    )


def _agreed_extensions(offered: MediaSection, own: LocalMedia, chosen: Mapping[str, int]) -> Iterator[HeaderExtension]:
    for each in offered.extensions:
        number = each.id if each.id <= LARGEST_EXTENSION_ID else chosen[each.uri]
        if each.uri in own.extensions:
            yield HeaderExtension(number, each.uri, reverse(each.direction))


def _chosen_ids(offer: SessionDescription) -> dict[str, int]:
    """Return ids for the extensions whose id the answer chooses; equal in every section, as RFC 9143 9.2 wants."""
    extensions = [each for section in offer.sections for each in section.extensions]
    used = {each.id for each in extensions} | {RESERVED_ID}
    free = (number for number in range(1, LARGEST_EXTENSION_ID + 1) if number not in used)
    wanted = dict.fromkeys(each.uri for each in extensions if each.id > LARGEST_EXTENSION_ID)
    chosen = dict(zip(wanted, free, strict=False))
    if len(chosen) < len(wanted):
        raise SdpError(f"more than {LARGEST_EXTENSION_ID} header extensions")
    return chosen


# Offering


def media_section(mid: str, kind: str, own: LocalMedia, ids: Mapping[str, int]) -> MediaSection:
    """Return a section of an offer. `ids`: of the header extensions, by URI; the same for every section."""
    sends = own.direction in ("sendrecv", "sendonly")
    return MediaSection(
        kind=kind,
        mid=mid,
        direction=own.direction,
        codecs=tuple(own.codecs),
        extensions=tuple(HeaderExtension(ids[uri], uri) for uri in own.extensions),
        sources=own.sources if sends else (),
        source_groups=own.source_groups if sends else (),
        msid=own.msid if sends else "",
        reduced_size=True,
    )


def data_section(mid: str, max_message_size: int | None = None) -> MediaSection:
    """Return a section for data channels (RFC 8841 4)."""
    return MediaSection(
        kind="application",
        mid=mid,
        protocol="UDP/DTLS/SCTP",
        formats=("webrtc-datachannel",),
        rtcp_mux=False,
        sctp_port=5000,
        max_message_size=max_message_size,
    )


def offer_of(
    sections: Sequence[MediaSection], transport: Transport, *, session_id: int = 0, version: int = 1
) -> SessionDescription:
    """Return an offer of these sections. The peer chooses who opens DTLS (RFC 8842 5.2)."""
    return SessionDescription(replace(transport, setup="actpass"), tuple(sections), session_id, version)


def check_answer(offer: SessionDescription, answer: SessionDescription) -> None:
    """Check that `answer` answers `offer`. Then its sections are in use. Raises SdpError."""
    if len(offer.sections) != len(answer.sections):
        raise SdpError(f"{len(answer.sections)} sections for the offer's {len(offer.sections)} (RFC 3264 6)")
    if answer.transport.setup not in ("active", "passive"):
        raise SdpError("an answer chooses active or passive (RFC 8842 5.3)")
    for offered, answered in zip(offer.sections, answer.sections, strict=True):
        if not answered.rejected:
            _check_section(offered, answered)


def _check_section(offered: MediaSection, answered: MediaSection) -> None:
    mid = answered.mid
    if (offered.mid, offered.kind) != (answered.mid, answered.kind):
        raise SdpError(f"stands where the offer has section {offered.mid} (RFC 3264 6)", mid)
    if offered.rejected:
        raise SdpError("was not offered (RFC 3264 6)", mid)
    if not answered.is_media:
        return
    for codec in answered.codecs:
        if not any(is_same_format(codec, each) for each in offered.codecs):
            raise SdpError(f"the codec {codec.name} was not offered (RFC 3264 6.1)", mid)
    if not answered.codecs:
        raise SdpError("no codec", mid)
    if both(answered.direction, reverse(offered.direction)) != answered.direction:
        raise SdpError(f"{answered.direction} does not answer {offered.direction} (RFC 3264 6.1)", mid)
    for extension in answered.extensions:
        number = offered.extension_id(extension.uri)
        if number is None or (number <= LARGEST_EXTENSION_ID and number != extension.id):
            raise SdpError(f"the header extension {extension.id} was not offered so (RFC 8285 6)", mid)
