"""Writes session descriptions (RFC 8866), in the order of RFC 8829 5.2.1."""

from collections.abc import Iterator, Mapping

from lockstep.rtc.sdp.description import Codec, HeaderExtension, MediaSection, SessionDescription, Transport

__all__ = ["write_description"]

DISCARD_PORT = 9  # RFC 8829 5.2.1: the candidates count
UNSPECIFIED = "IN IP4 0.0.0.0"


def write_description(description: SessionDescription) -> str:
    """Return the text of `description`."""
    return "\r\n".join([*_lines(description), ""])


def _lines(description: SessionDescription) -> Iterator[str]:
    accepted, transport = description.accepted, description.transport
    yield "v=0"
    yield f"o=- {description.session_id} {description.version} {UNSPECIFIED}"
    yield "s=-"
    yield "t=0 0"
    yield " ".join(["a=group:BUNDLE", *(section.mid for section in accepted)])
    if transport.lite:
        yield "a=ice-lite"
    if description.allow_mixed:
        yield "a=extmap-allow-mixed"
    if transport.ice_options:
        yield f"a=ice-options:{' '.join(transport.ice_options)}"
    yield "a=msid-semantic:WMS *"
    for section in description.sections:
        yield from _section(section)
        if not section.rejected:
            yield from _transport(transport, with_candidates=section is accepted[0])


def _section(section: MediaSection) -> Iterator[str]:
    port = 0 if section.rejected else DISCARD_PORT
    numbers = [str(codec.payload_type) for codec in section.codecs]
    yield f"m={section.kind} {port} {section.protocol} {' '.join(numbers or section.formats)}"
    yield f"c={UNSPECIFIED}"
    yield f"a=mid:{section.mid}"
    if section.rejected:
        yield "a=inactive"
    elif section.is_media:
        yield from _media(section)
    elif section.sctp_port is not None:
        yield f"a=sctp-port:{section.sctp_port}"
        if section.max_message_size is not None:
            yield f"a=max-message-size:{section.max_message_size}"
        for channel in section.channel_maps:
            yield f"a=dcmap:{channel}"


def _media(section: MediaSection) -> Iterator[str]:
    yield f"a=rtcp:{DISCARD_PORT} {UNSPECIFIED}"
    yield f"a={section.direction}"
    if section.msid:
        yield f"a=msid:{section.msid}"
    if section.rtcp_mux:
        yield "a=rtcp-mux"
    if section.reduced_size:
        yield "a=rtcp-rsize"
    for extension in section.extensions:
        yield _extension(extension)
    for codec in section.codecs:
        yield from _codec(codec)
    for group in section.source_groups:
        yield f"a=ssrc-group:{group.semantics} {' '.join(map(str, group.ssrcs))}"
    for source in section.sources:
        if not source.attributes:
            yield f"a=ssrc:{source.ssrc}"
        for name, value in source.attributes.items():
            yield f"a=ssrc:{source.ssrc} {_pair(name, value, ':')}"


def _extension(extension: HeaderExtension) -> str:
    way = "" if extension.direction == "sendrecv" else f"/{extension.direction}"
    return f"a=extmap:{extension.id}{way} {extension.uri}"


def _codec(codec: Codec) -> Iterator[str]:
    channels = "" if codec.channels == 1 else f"/{codec.channels}"
    yield f"a=rtpmap:{codec.payload_type} {codec.name}/{codec.clock_rate}{channels}"
    for feedback in codec.feedback:
        yield f"a=rtcp-fb:{codec.payload_type} {feedback}"
    if codec.parameters:
        yield f"a=fmtp:{codec.payload_type} {_joined(codec.parameters)}"


def _joined(parameters: Mapping[str, str]) -> str:
    return ";".join(_pair(name, value, "=") for name, value in parameters.items())


def _pair(name: str, value: str, between: str) -> str:
    return f"{name}{between}{value}" if value else name


def _transport(transport: Transport, *, with_candidates: bool) -> Iterator[str]:
    """Yield the transport's lines for each section, where peers look for them (RFC 8829 5.3.1); candidates for the
    tagged one only."""
    yield f"a=ice-ufrag:{transport.ufrag}"
    yield f"a=ice-pwd:{transport.password}"
    for fingerprint in transport.fingerprints:
        yield f"a=fingerprint:{fingerprint}"
    yield f"a=setup:{transport.setup}"
    if with_candidates:
        for candidate in transport.candidates:
            yield f"a={candidate}"
        if transport.end_of_candidates:
            yield "a=end-of-candidates"
