"""Reads and writes the few parts of SDP that the client handles itself. Text in, text out; no I/O."""

import re
from dataclasses import dataclass, field

__all__ = ["Section", "read_sections", "replace_candidates"]

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
        """True if, in an answer, the other side sends here."""
        return self.kind in ("audio", "video") and self.direction in ("sendonly", "sendrecv")


def read_sections(sdp: str) -> list[Section]:
    """Return the media sections, in order. Unknown lines are skipped."""
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


def replace_candidates(sdp: str, host: str, port: int) -> str:
    """Return the description with one host candidate, `host:port`, in place of each section's candidates, so that a
    forwarder can stand between."""
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
