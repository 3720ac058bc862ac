"""The little of SDP that the client reads and writes by itself. Text in, text out; no I/O."""

import re
from dataclasses import dataclass, field

__all__ = ["Section", "offer_extension", "read_sections", "replace_candidates"]

# What aiortc needs of its own; everything else in its process-wide list belongs to somebody else.
KEPT_EXTENSIONS = {
    "urn:ietf:params:rtp-hdrext:sdes:mid",
    "http://www.webrtc.org/experiments/rtp-hdrext/abs-send-time",
}
EXTMAP = re.compile(r"a=extmap:(\d+)(?:/\w+)? (\S+)")
RTPMAP = re.compile(r"a=rtpmap:(\d+) ([^/\s]+)")
SSRC = re.compile(r"a=ssrc:(\d+)")
CANDIDATE = re.compile(r"a=candidate:(\S+) (\d+) (\S+) (\d+) (\S+) (\d+) typ host.*")


@dataclass
class Section:
    """One media section of a description."""

    kind: str  # "audio", "video", "application"
    mid: str = ""
    direction: str = "sendrecv"
    stream: str = ""  # the id of its msid: the name of the camera or microphone
    codecs: dict[int, str] = field(default_factory=dict)  # payload type → name, in order of preference
    extensions: dict[str, int] = field(default_factory=dict)  # URI → id
    ssrcs: list[int] = field(default_factory=list)

    @property
    def receives(self) -> bool:
        """Whether, in an answer, the other side sends here."""
        return self.kind in ("audio", "video") and self.direction in ("sendonly", "sendrecv")


def read_sections(sdp: str) -> list[Section]:
    """The media sections, in order. Lines that it does not know are skipped."""
    sections: list[Section] = []
    for line in sdp.splitlines():
        if line.startswith("m="):
            sections.append(Section(kind=line[2:].split(" ", 1)[0]))
        elif sections:
            _read_line(sections[-1], line)
    return sections


def _read_line(section: Section, line: str) -> None:
    if line in ("a=sendrecv", "a=sendonly", "a=recvonly", "a=inactive"):
        section.direction = line[2:]
    elif line.startswith("a=mid:"):
        section.mid = line[6:]
    elif line.startswith("a=msid:"):
        section.stream = line[7:].split(" ", 1)[0]
    elif match := RTPMAP.match(line):
        section.codecs[int(match[1])] = match[2]
    elif match := EXTMAP.match(line):
        section.extensions[match[2]] = int(match[1])
    elif (match := SSRC.match(line)) and int(match[1]) not in section.ssrcs:
        section.ssrcs.append(int(match[1]))


def offer_extension(sdp: str, uri: str | None) -> str:
    """The offer with `uri` (none if None) in every audio and video section, and no other foreign extension.

    The id is the same in all sections, as a BUNDLE demands (RFC 8843 9.1).
    """
    used = {int(match[1]) for match in EXTMAP.finditer(sdp) if match[2] in KEPT_EXTENSIONS}
    free = next(number for number in range(1, 15) if number not in used)
    lines: list[str] = []
    for line in sdp.splitlines():
        match = EXTMAP.match(line)
        if match and match[2] not in KEPT_EXTENSIONS:
            continue
        lines.append(line)
        if uri is not None and line.startswith("a=mid:") and _kind_at_end(lines) in ("audio", "video"):
            lines.append(f"a=extmap:{free} {uri}")
    return "\r\n".join(lines) + "\r\n"


def _kind_at_end(lines: list[str]) -> str:
    return next((line[2:].split(" ", 1)[0] for line in reversed(lines) if line.startswith("m=")), "")


def replace_candidates(sdp: str, host: str, port: int) -> str:
    """The description with one host candidate, `host:port`, in place of each section's own: for a relay between."""
    lines: list[str] = []
    replaced = False  # in the current section
    for line in sdp.splitlines():
        if line.startswith("m="):
            replaced = False
        match = CANDIDATE.match(line)
        if match and not replaced:
            lines.append(f"a=candidate:{match[1]} {match[2]} udp {match[4]} {host} {port} typ host")
            replaced = True
        elif not line.startswith("a=candidate:"):
            lines.append(line)
    return "\r\n".join(lines) + "\r\n"
