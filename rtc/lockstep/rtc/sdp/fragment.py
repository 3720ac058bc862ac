"""Fragments that bring candidates or an ICE restart to a running session (RFC 8840 9)."""

import re
from dataclasses import dataclass, field
from typing import NamedTuple

from lockstep.rtc.sdp.errors import SdpError

__all__ = ["Fragment", "FragmentCandidate", "parse_fragment", "write_fragment"]

MAX_TEXT = 64 * 1024  # characters; of MAX_CANDIDATES long ones there are fewer
MAX_CANDIDATES = 100
UFRAG = re.compile(r"[A-Za-z0-9+/]{4,256}")  # RFC 8839 5.4
PASSWORD = re.compile(r"[A-Za-z0-9+/]{22,256}")
MID = re.compile(r"[!-~]{1,64}")


class FragmentCandidate(NamedTuple):
    """A candidate, and the media section that it is for."""

    mid: str
    line: str  # "candidate:…", without "a="


@dataclass(frozen=True, slots=True)
class Fragment:
    """The content of a fragment."""

    ufrag: str = ""  # "" when it names none
    password: str = field(default="", repr=False)
    candidates: tuple[FragmentCandidate, ...] = ()
    end_of_candidates: bool = False


def parse_fragment(text: str, first_mid: str) -> Fragment:
    """Return the fragment in `text`. Raises SdpError.

    Args:
        first_mid: for lines before the first media section; with BUNDLE all candidates are for it
    """
    if len(text) > MAX_TEXT:
        raise SdpError(f"more than {MAX_TEXT} characters")
    ufrag = password = ""
    candidates: list[FragmentCandidate] = []
    mid, ended = first_mid, False
    for line in (line.rstrip("\r") for line in text.split("\n")):
        name, _, value = line.partition(":")
        value = value.strip()
        if name == "a=mid":
            mid = value
        elif name == "a=ice-ufrag":
            ufrag = _same(value, UFRAG, ufrag)
        elif name == "a=ice-pwd":
            password = _same(value, PASSWORD, password)
        elif name == "a=candidate":
            candidates.append(FragmentCandidate(mid, line[2:]))
        elif name == "a=end-of-candidates":
            ended = True
        elif line and line[1:2] != "=":
            raise SdpError("a line that is not SDP")
        if not MID.fullmatch(mid) or len(candidates) > MAX_CANDIDATES:
            raise SdpError(f"a mid that is not one, or more than {MAX_CANDIDATES} candidates")
    return Fragment(ufrag, password, tuple(candidates), ended)


def _same(value: str, allowed: re.Pattern[str], before: str) -> str:
    """Check a credential and return it: all sections of a bundle have the same ones."""
    if not allowed.fullmatch(value) or before not in ("", value):
        raise SdpError("ice-ufrag or ice-pwd is not valid")
    return value


def write_fragment(fragment: Fragment, kind: str, mid: str) -> str:
    """Return the text of `fragment`, with all candidates for the bundle's transport: section `mid` of `kind`."""
    lines = [f"a=ice-ufrag:{fragment.ufrag}", f"a=ice-pwd:{fragment.password}"] if fragment.ufrag else []
    lines += [f"m={kind} 9 UDP/TLS/RTP/SAVPF 0", f"a=mid:{mid}"]
    lines += [f"a={each.line}" for each in fragment.candidates]
    if fragment.end_of_candidates:
        lines.append("a=end-of-candidates")
    return "\r\n".join([*lines, ""])
