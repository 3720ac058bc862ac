"""Makes every media section of a checked offer one that aiortc can answer, and rejects those that nobody can. No I/O.

An answer has to have a section for each of the offer's (RFC 3264 6). aiortc refuses the whole offer where one section
has no codec that it knows, leaves out its direction, or has a static payload type without a mapping. Here the first of
these is shown to aiortc as an inactive section with a codec that it knows, and put right in the answer: port zero, and
no part in the bundle.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from aiortc.codecs import CODECS
from aiortc.rtcpeerconnection import find_common_codecs
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from aiortc.sdp import SessionDescription

from server.agreed_channels import CHANNEL_LINE
from server.errors import BadSdp

__all__ = ["AnswerableOffer", "answerable"]

DIRECTIONS = ("a=sendrecv", "a=sendonly", "a=recvonly", "a=inactive")
STATIC_PAYLOADS = {"0": "PCMU/8000", "8": "PCMA/8000", "9": "G722/8000"}  # RFC 3551 6, of those that can be answered
OF_CODECS = ("a=rtpmap:", "a=fmtp:", "a=rtcp-fb:")
STAND_IN = {"audio": ("8", "PCMA/8000"), "video": ("", "VP8/90000")}  # "": with the first number of the section


class AnswerableOffer(NamedTuple):
    """What aiortc is shown, and what it is not to answer."""

    text: str
    rejected: dict[str, str]  # mid -> the offer's own m= line
    channels: list[str]  # lines of the data channels that are agreed on; RFC 8864 6.4: the answer says the same

    def receives(self, kind: str) -> int:
        """How many sections of "video" or "audio" want something."""
        _, sections = _split(self.text.splitlines())
        wanted = ("a=recvonly", "a=sendrecv")
        return sum(each[0].startswith(f"m={kind} ") and any(line in wanted for line in each) for each in sections)

    def answer(self, made: str) -> str:
        """aiortc's answer with a word about trickling, and rejected sections by RFC 3264 6 and RFC 9143 7.3.3."""
        head, sections = _split(made.splitlines())
        head.append("a=ice-options:trickle")  # RFC 8840 4.1.1: the console takes further candidates by PATCH
        lines = [self._without_rejected(line) if line.startswith("a=group:BUNDLE") else line for line in head]
        for section in sections:
            mid = _value(section, "a=mid:")
            lines += self._rejection(mid) if mid in self.rejected else section
            if section[0].startswith("m=application "):
                lines += self.channels
        return "\r\n".join(lines) + "\r\n"

    def _without_rejected(self, group: str) -> str:
        return " ".join(each for each in group.split() if each not in self.rejected)

    def _rejection(self, mid: str) -> list[str]:
        kind, _, rest = self.rejected[mid].split(" ", 2)
        return [f"{kind} 0 {rest}", "c=IN IP4 0.0.0.0", "a=inactive", f"a=mid:{mid}"]


def answerable(text: str) -> AnswerableOffer:
    """`text` is what `prepare_offer` returned.

    The peer is to open DTLS where it leaves the choice (RFC 8842 5.2): it knows first that ICE has found a path, and a
    peer with an RSA certificate, as GStreamer has, finds no cipher suite in common when aiortc is the client.

    Raises:
        BadSdp: no section has a codec that can be answered, and there are no data channels.
    """
    head, sections = _split(text.splitlines())
    direction = next((line for line in head if line in DIRECTIONS), "a=sendrecv")  # RFC 8866 6.7
    sections = [_complete(section, direction) for section in sections]
    parsed = SessionDescription.parse("\r\n".join([*head, *(line for each in sections for line in each), ""])).media
    rejected: dict[str, str] = {}
    for number, (section, media) in enumerate(zip(sections, parsed, strict=True)):
        if media.kind != "application" and not _in_common(media.kind, media.rtp.codecs):
            rejected[media.rtp.muxId] = section[0]
            sections[number] = _stand_in(section, media.kind)
    if len(rejected) == len(sections):
        raise BadSdp("; ".join(f"section {mid}: no codec in common" for mid in rejected)[:500])
    lines = [*head, *(line for section in sections for line in section)]
    lines = ["a=setup:active" if line == "a=setup:actpass" else line for line in lines]
    channels = [line for line in lines if line.startswith(CHANNEL_LINE)]
    return AnswerableOffer("\r\n".join(lines) + "\r\n", rejected, channels)


def _in_common(kind: str, offered: list[RTCRtpCodecParameters]) -> bool:
    common = find_common_codecs(CODECS[kind], offered)
    return any(codec.name.lower() not in ("rtx", "telephone-event") for codec in common)


def _split(lines: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """The lines of the session, and those of each media section."""
    starts = [number for number, line in enumerate(lines) if line.startswith("m=")]
    ends = [*starts[1:], len(lines)]
    return list(lines[: starts[0]]) if starts else list(lines), [
        list(lines[start:end]) for start, end in zip(starts, ends, strict=True)
    ]


def _complete(section: list[str], direction: str) -> list[str]:
    """With what may be left out, and aiortc needs."""
    if section[0].startswith("m=application"):
        return section
    more = [] if any(line in DIRECTIONS for line in section) else [direction]
    mapped = {line[len("a=rtpmap:") :].split(" ")[0] for line in section if line.startswith("a=rtpmap:")}
    for payload in section[0].split()[3:]:
        if payload in STATIC_PAYLOADS and payload not in mapped and section[0].startswith("m=audio"):
            more.append(f"a=rtpmap:{payload} {STATIC_PAYLOADS[payload]}")
    return [*section, *more]


def _stand_in(section: list[str], kind: str) -> list[str]:
    number, codec = STAND_IN[kind]
    words = section[0].split()
    number = number or next((each for each in words[3:] if 96 <= int(each) <= 127), "96")
    return [" ".join([*words[:3], number]), *_kept(section[1:]), "a=inactive", f"a=rtpmap:{number} {codec}"]


def _kept(section: list[str]) -> Iterator[str]:
    for line in section:
        if line not in DIRECTIONS and not line.startswith((*OF_CODECS, "a=ssrc", "a=msid", "a=rid", "a=simulcast")):
            yield line


def _value(section: Sequence[str], name: str) -> str:
    return next((line[len(name) :].strip() for line in section if line.startswith(name)), "")
