"""Reads session descriptions (RFC 8866) of one BUNDLE, as browsers, aiortc, Janus, GStreamer and others write them.

Unknown lines are left out, as RFC 8866 5.13 asks. A description without the lines that one BUNDLE needs is refused as a
whole; a codec or header extension that no packet could carry is left out.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.sdp.codecs import read_codecs
from lockstep.rtc.sdp.description import (
    LARGEST_EXTENSION_ID,
    Direction,
    HeaderExtension,
    MediaSection,
    SessionDescription,
    Setup,
    Source,
    SourceGroup,
    Transport,
    rejection_of,
)
from lockstep.rtc.sdp.errors import SdpError

__all__ = ["SdpLimits", "parse_description"]

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
ICE_CHARS = re.compile(r"[A-Za-z0-9+/]+")
TOKEN = re.compile(r"[!#-'*+\-.0-9A-Z^-~]{1,64}")  # RFC 8866 9
EXTMAP = re.compile(r"([0-9]{1,9})(?:/(sendrecv|sendonly|recvonly|inactive))? +([!-~]+)(?: .*)?")
NUMBER = re.compile(r"[0-9]{1,10}")
RTP = re.compile(r"((UDP|TCP)/(TLS|DTLS)/)?RTP/S?AVPF?")  # RFC 8829 5.1.2: the name is ignored
SCTP = ("UDP/DTLS/SCTP", "TCP/DTLS/SCTP")  # RFC 8841 4.1
DIRECTIONS: dict[str, Direction] = {
    "sendrecv": "sendrecv", "sendonly": "sendonly", "recvonly": "recvonly", "inactive": "inactive"
}  # fmt: skip
SETUPS: dict[str, Setup] = {"actpass": "actpass", "active": "active", "passive": "passive"}
TO_BE_CHOSEN = range(4096, 4352)  # RFC 8285 5
MAX_U32 = (1 << 32) - 1


@dataclass(frozen=True, slots=True)
class SdpLimits:
    """Bounds on the text of a peer."""

    text: int = 256 * 1024  # characters; a section of Chromium with all its codecs has 7,000
    sections: int = 64  # each costs work for as long as the session lasts
    candidates: int = 100  # of one section; a host with many networks has some thirty
    sources: int = 64  # of one section; simulcast with retransmission has six
    fingerprints: int = 16  # of one section; one for each hash and certificate
    channel_maps: int = 64  # of one section


@dataclass(slots=True)
class _Lines:
    """The attributes of the session or of one section."""

    media: str = ""  # the m= line
    attributes: list[tuple[str, str]] = field(default_factory=list)

    def all(self, name: str) -> list[str]:
        return [value for key, value in self.attributes if key == name]

    def first(self, name: str) -> str | None:
        return next((value for key, value in self.attributes if key == name), None)

    def has(self, name: str) -> bool:
        return any(key == name for key, _ in self.attributes)

    def direction(self) -> Direction | None:
        return next((DIRECTIONS[key] for key, _ in self.attributes if key in DIRECTIONS), None)


def parse_description(text: str, limits: SdpLimits | None = None) -> SessionDescription:
    """Return the description in `text`. Raises SdpError."""
    limits = limits or SdpLimits()
    if len(text) > limits.text:
        raise SdpError(f"more than {limits.text} characters")
    origin, session, media = _split(text, limits.sections)
    sections = [_section(lines, session, place, limits) for place, lines in enumerate(media)]
    _check_mids(sections)
    tagged = _tagged(session, sections)
    version = origin.split()[1:3] if len(origin.split()) == 6 else []
    numbers = [int(each) if each.isascii() and each.isdecimal() and len(each) <= 20 else 0 for each in version] or [
        0,
        0,
    ]
    return SessionDescription(
        transport=_transport(media[tagged], session, sections[tagged].mid, limits),
        sections=tuple(sections),
        session_id=numbers[0],
        version=numbers[1],
        allow_mixed=session.has("extmap-allow-mixed") or media[tagged].has("extmap-allow-mixed"),
    )


def _split(text: str, most: int) -> tuple[str, _Lines, list[_Lines]]:
    """Return the origin, the session's attributes and each section's."""
    lines = [line.rstrip("\r") for line in text.split("\n")]  # RFC 8866 5: a lone line feed is accepted
    if lines[0] != "v=0":
        raise SdpError('does not begin with "v=0"')
    origin, session, media = "", _Lines(), list[_Lines]()
    for line in lines[1:]:
        if not line:
            continue
        if line[1:2] != "=" or CONTROL.search(line):
            raise SdpError("a line that is not SDP")
        if line[0] == "m":
            if len(media) == most:
                raise SdpError(f"more than {most} media sections")
            media.append(_Lines(line[2:]))
        elif line[0] == "a":
            name, _, value = line[2:].partition(":")
            (media[-1] if media else session).attributes.append((name.strip(), value.strip()))
        elif line[0] == "o" and not media:
            origin = line[2:]
    if not media:
        raise SdpError("no media section")
    return origin, session, media


def _check_mids(sections: Sequence[MediaSection]) -> None:
    mids = [section.mid for section in sections]
    doubled = next((mid for mid in mids if mids.count(mid) > 1), None)
    if doubled is not None:
        raise SdpError("its mid is another section's as well (RFC 9143 7.2.1)", doubled)
    data = [section.mid for section in sections if section.sctp_port is not None]
    if len(data) > 1:
        raise SdpError("a second section of data channels", data[1])


def _tagged(session: _Lines, sections: Sequence[MediaSection]) -> int:
    """Return the place of the section whose transport all sections share (RFC 9143 7.2)."""
    bundles = [value.split()[1:] for value in session.all("group") if value.split()[:1] == ["BUNDLE"]]
    live = [section.mid for section in sections if not section.rejected]
    if not live:
        raise SdpError("every section is rejected")
    if len(bundles) != 1 or len(set(bundles[0])) != len(bundles[0]):
        raise SdpError("needs exactly one BUNDLE group (RFC 9143 7.2.1)")
    outside = next((mid for mid in live if mid not in bundles[0]), None)
    if outside is not None:
        raise SdpError("is not in the BUNDLE group", outside)
    mids = [section.mid for section in sections]
    stray = next((mid for mid in bundles[0] if mid not in mids), None)
    if stray is not None:
        raise SdpError("the BUNDLE group names a section that is not there")
    return mids.index(next(mid for mid in bundles[0] if mid in live))


def _section(lines: _Lines, session: _Lines, place: int, limits: SdpLimits) -> MediaSection:
    mid = lines.first("mid")
    name = mid if mid is not None and TOKEN.fullmatch(mid) else f"#{place}"
    words = lines.media.split()
    if len(words) < 4 or not NUMBER.fullmatch(words[1]) or not TOKEN.fullmatch(words[0]):
        raise SdpError("an m= line that is not one (RFC 8866 5.14)", name)
    rejected = words[1] == "0" and not lines.has("bundle-only")  # RFC 9143 6
    if name != mid and not rejected:
        raise SdpError("needs a mid of its own (RFC 9143 7.2.1)", name)
    kind, protocol = words[0], words[2]
    if rejected:
        return rejection_of(kind, name, protocol, tuple(words[3:]))
    is_media = kind in ("audio", "video") and RTP.fullmatch(protocol) is not None
    is_data = kind == "application" and protocol in SCTP and words[3] == "webrtc-datachannel"
    section = MediaSection(
        kind=kind,
        mid=name,
        protocol=protocol,
        formats=tuple(words[3:]),
        direction=lines.direction() or session.direction() or "sendrecv",  # RFC 8866 6.7
        rtcp_mux=lines.has("rtcp-mux"),
        reduced_size=lines.has("rtcp-rsize"),
        msid=lines.first("msid") or "",
        codecs=read_codecs(words[3:], lines.attributes, kind, name) if is_media else (),
        extensions=_extensions([*session.all("extmap"), *lines.all("extmap")], name) if is_media else (),
        sources=_sources(lines.all("ssrc"), limits.sources, name) if is_media else (),
        source_groups=_groups(lines.all("ssrc-group"), limits.sources, name) if is_media else (),
        sctp_port=_number(lines.first("sctp-port"), "sctp-port", 65535, name) if is_data else None,
        max_message_size=_number(lines.first("max-message-size"), "max-message-size", 1 << 53, name)
        if is_data
        else None,
        channel_maps=tuple(lines.all("dcmap")) if is_data else (),
    )
    if len(section.channel_maps) > limits.channel_maps:
        raise SdpError(f"more than {limits.channel_maps} data channels", name)
    if is_data and section.sctp_port is None:
        raise SdpError("needs a=sctp-port (RFC 8841 5)", name)
    if is_media and not section.rtcp_mux:
        raise SdpError("needs a=rtcp-mux (RFC 8834 4.5)", name)
    return section


def _number(text: str | None, what: str, most: int, section: str) -> int | None:
    if text is None:
        return None
    if not text.isascii() or not text.isdecimal() or len(text) > 16 or int(text) > most:
        raise SdpError(f"{what} is a number of at most {most}", section)
    return int(text)


def _extensions(values: Iterable[str], section: str) -> tuple[HeaderExtension, ...]:
    """Return the extensions whose id a packet can carry, or the answer is to choose (RFC 8285 5)."""
    found: dict[int, HeaderExtension] = {}
    for value in values:
        match = EXTMAP.fullmatch(value)
        if match is None:
            raise SdpError("a header extension without an id and a URI (RFC 8285 8)", section)
        number = int(match[1])
        if not 1 <= number <= LARGEST_EXTENSION_ID and number not in TO_BE_CHOSEN:
            continue
        extension = HeaderExtension(number, match[3], DIRECTIONS[match[2] or "sendrecv"])
        if found.setdefault(number, extension).uri != extension.uri:
            raise SdpError(f"two header extensions with the id {number} (RFC 8285 5)", section)
    uris: dict[str, HeaderExtension] = {}
    for extension in found.values():
        uris.setdefault(extension.uri, extension)  # RFC 8285 5: one is enough
    return tuple(uris.values())


def _sources(values: Iterable[str], most: int, section: str) -> tuple[Source, ...]:
    found: dict[int, dict[str, str]] = {}
    for value in values:
        number, _, attribute = value.partition(" ")
        ssrc = _ssrc(number, section)
        name, _, content = attribute.strip().partition(":")
        attributes = found.setdefault(ssrc, {})
        if name:
            attributes[name] = content
        if len(found) > most:
            raise SdpError(f"more than {most} sources", section)
    return tuple(Source(ssrc, attributes) for ssrc, attributes in found.items())


def _groups(values: Sequence[str], most: int, section: str) -> tuple[SourceGroup, ...]:
    if len(values) > most:
        raise SdpError(f"more than {most} groups of sources", section)
    words = [value.split() for value in values]
    return tuple(SourceGroup(each[0], tuple(_ssrc(x, section) for x in each[1:])) for each in words if each)


def _ssrc(text: str, section: str) -> int:
    if not NUMBER.fullmatch(text) or int(text) > MAX_U32:
        raise SdpError("a source without a number (RFC 5576 4.1)", section)
    return int(text)


def _transport(lines: _Lines, session: _Lines, section: str, limits: SdpLimits) -> Transport:
    """Return the transport of the section, or where it says nothing, of the session (RFC 8839 5.4, RFC 8842 5.1)."""

    def value(name: str) -> str | None:
        return lines.first(name) or session.first(name)

    ufrag, password = value("ice-ufrag") or "", value("ice-pwd") or ""
    if not (ICE_CHARS.fullmatch(ufrag) and 4 <= len(ufrag) <= 256):
        raise SdpError("needs a=ice-ufrag of 4 to 256 letters, digits, + and / (RFC 8839 5.4)", section)
    if not (ICE_CHARS.fullmatch(password) and 22 <= len(password) <= 256):
        raise SdpError("needs a=ice-pwd of 22 to 256 letters, digits, + and / (RFC 8839 5.4)", section)
    setup = SETUPS.get(value("setup") or "")
    if setup is None:
        raise SdpError("needs a=setup: actpass, active or passive (RFC 8842 5.2)", section)
    candidates = lines.all("candidate")
    if len(candidates) > limits.candidates:
        raise SdpError(f"more than {limits.candidates} candidates", section)
    return Transport(
        ufrag=ufrag,
        password=password,
        fingerprints=_fingerprints(lines.all("fingerprint") or session.all("fingerprint"), section, limits),
        setup=setup,
        candidates=tuple(f"candidate:{each}" for each in candidates),
        end_of_candidates=lines.has("end-of-candidates"),
        ice_options=tuple(word for each in (lines, session) for word in " ".join(each.all("ice-options")).split()),
        lite=session.has("ice-lite"),
    )


def _fingerprints(values: Sequence[str], section: str, limits: SdpLimits) -> tuple[Fingerprint, ...]:
    if not 1 <= len(values) <= limits.fingerprints:
        raise SdpError(f"needs a=fingerprint, at most {limits.fingerprints} of them (RFC 8122 5)", section)
    try:
        return tuple(Fingerprint.parse(value) for value in values)
    except ValueError as error:
        raise SdpError(str(error), section) from error
