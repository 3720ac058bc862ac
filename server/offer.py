"""Checks a WHEP offer before anything is built on it, and takes out what aiortc should not see. No I/O."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from aiortc import sdp

from server.errors import BadSdp, BadSdpFragment, TooManySections
from server.extension_ids import with_usable_ids

__all__ = [
    "MAX_CANDIDATES",
    "MAX_SECTIONS",
    "Fragment",
    "FragmentCandidate",
    "format_fragment",
    "parse_fragment",
    "prepare_offer",
]

MAX_SECTIONS = 16  # media sections, of a robot with fewer streams; each costs the event loop a millisecond
MAX_PAYLOAD_TYPE = 127  # RFC 3550 5.1: seven bits
MAX_CANDIDATES = 100  # of a section
DEFAULT_MESSAGE_SIZE = "a=max-message-size:65536"
HOST_NAME = re.compile(r"(?=.*[A-Za-z])[A-Za-z0-9-]+(\.[A-Za-z0-9-]+)+\.?|[A-Za-z][A-Za-z0-9-]*")
HEX_PAIRS = re.compile(r"[0-9A-Fa-f]{2}(:[0-9A-Fa-f]{2})+")
HASH_BYTES = {"sha-1": 20, "sha-224": 28, "sha-256": 32, "sha-384": 48, "sha-512": 64}  # RFC 8122 5
ICE_USERNAME = re.compile(r"[A-Za-z0-9+/]{4,256}")
ICE_PASSWORD = re.compile(r"[A-Za-z0-9+/]{22,256}")


def prepare_offer(text: str, max_sections: int = MAX_SECTIONS) -> str:
    """`text` without candidates whose address is a name, and with the message size that RFC 8841 6.1 leaves out.

    Header extensions whose ids fit no packet have another id in it, or are left out (`with_usable_ids`).

    The browser connects to us, so we learn its address from its checks (RFC 8445 7.3.1.3); to resolve its `.local`
    names would cost a second of multicast. When all that is left says "that was all", that is taken out too, or
    ICE would give up at once.

    Raises:
        BadSdp: not an offer that can be answered.
    """
    lines = text.splitlines()
    _count(lines, max_sections)
    _check_payload_types(lines)
    kept = [line for line in lines if not (line.startswith("a=candidate:") and _has_name(line))]
    if len(kept) != len(lines):
        kept = [line for line in kept if line != "a=end-of-candidates"]
    kept = with_usable_ids(kept)
    if not any(line.startswith("a=max-message-size:") for line in kept):
        kept = [
            each
            for line in kept
            for each in ([line, DEFAULT_MESSAGE_SIZE] if line.startswith("a=sctp-port:") else [line])
        ]
    prepared = "\r\n".join(kept) + "\r\n"
    _check(prepared)
    return prepared


def _has_name(candidate: str) -> bool:
    """Whether its address is a name: mDNS (`.local`), or a host's, which is to be discarded in silence."""
    words = candidate.split()
    return len(words) > 4 and HOST_NAME.fullmatch(words[4]) is not None


def _count(lines: Sequence[str], max_sections: int) -> None:
    """Before aiortc's parser, which takes longer over thousands of them than an operator's message may wait."""
    sections = sum(line.startswith("m=") for line in lines)
    if sections > max_sections:
        raise TooManySections(f"more than {max_sections} media sections")
    if sum(line.startswith("a=candidate:") for line in lines) > max(1, sections) * MAX_CANDIDATES:
        raise BadSdp(f"more than {MAX_CANDIDATES} candidates")


def _check_payload_types(lines: Sequence[str]) -> None:
    """aiortc keeps the lower seven bits of a larger one, and would answer with a number that was not offered."""
    for line in lines:
        if line.startswith(("m=audio ", "m=video ")):
            for each in line.split()[3:]:
                if each.isascii() and each.isdecimal() and int(each[:9]) > MAX_PAYLOAD_TYPE:
                    raise BadSdp(f"payload type {each[:9]}: 0 to {MAX_PAYLOAD_TYPE} fit a packet (RFC 3550 5.1)")


def _check(text: str) -> None:
    description = _parsed(text)
    if not description.media:
        raise BadSdp("the offer has no media section")
    if sum(media.kind == "application" for media in description.media) > 1:
        raise BadSdp("more than one data channel section")
    mids = [media.rtp.muxId for media in description.media]
    if not all(mids) or len(set(mids)) != len(mids):
        raise BadSdp("every media section needs a mid of its own (RFC 9143 7.2.1)")
    bundles = [group.items for group in description.group if group.semantic == "BUNDLE"]
    if len(bundles) != 1 or sorted(map(str, bundles[0])) != sorted(mids):
        raise BadSdp("exactly the media sections have to be in one BUNDLE group (RFC 9143 7.2.1)")
    for media in description.media:
        _check_media(media)


def _check_media(media: sdp.MediaDescription) -> None:
    if media.kind not in ("audio", "video", "application"):
        raise BadSdp(f"a media section of kind {media.kind!r}"[:80])
    if media.ice is None or not media.ice.usernameFragment or not media.ice.password:
        raise BadSdp("a media section without ice-ufrag and ice-pwd")
    if media.dtls is None or not media.dtls.fingerprints:
        raise BadSdp(f"section {media.rtp.muxId}: needs a=fingerprint and a=setup (RFC 8842 5)"[:120])
    for each in media.dtls.fingerprints:
        length = HASH_BYTES.get(each.algorithm.lower())
        if length is not None and (not HEX_PAIRS.fullmatch(each.value) or len(each.value) != 3 * length - 1):
            raise BadSdp(f"section {media.rtp.muxId}: a fingerprint that is none (RFC 8122 5)"[:120])
    if media.kind != "application" and not media.rtcp_mux:
        raise BadSdp(f"section {media.rtp.muxId}: needs a=rtcp-mux (RFC 8834 4.5)"[:120])
    if media.kind == "application" and media.sctp_port is None:
        raise BadSdp("a data channel section without sctp-port")
    if len(media.ice_candidates) > MAX_CANDIDATES:
        raise BadSdp(f"more than {MAX_CANDIDATES} candidates")


def _parsed(text: str) -> sdp.SessionDescription:
    try:
        return sdp.SessionDescription.parse(text)
    except Exception as error:
        # aiortc's parser has no error of its own: it fails with whatever the text made it trip over.
        raise BadSdp("the offer is not valid SDP") from error


class FragmentCandidate(NamedTuple):
    """One candidate of a fragment, and the media section it is for."""

    mid: str
    line: str  # "candidate:..." without the "a="


class Fragment(NamedTuple):
    """What an application/trickle-ice-sdpfrag says (RFC 8840 9)."""

    username: str  # ice-ufrag; "" when it names none
    password: str  # ice-pwd; "" likewise
    candidates: list[FragmentCandidate]


def parse_fragment(text: str, first_mid: str) -> Fragment:
    """The credentials and candidates in `text`.

    Its a=end-of-candidates is not passed on: the peer may still be reached from an address that only its checks show.
    Candidates with names are left out for the reason that `prepare_offer` gives.

    Args:
        first_mid: for lines before the first media section; with BUNDLE all candidates are for it

    Raises:
        BadSdpFragment: not a fragment.
    """
    username = password = ""
    candidates: list[FragmentCandidate] = []
    mid = first_mid
    for line in text.splitlines():
        if line.startswith("a=mid:"):
            mid = line[6:].strip()
        elif line.startswith("a=ice-ufrag:"):
            username = _ice_chars(line[12:].strip(), ICE_USERNAME, username)
        elif line.startswith("a=ice-pwd:"):
            password = _ice_chars(line[10:].strip(), ICE_PASSWORD, password)
        elif line.startswith("a=candidate:"):
            if len(candidates) == MAX_CANDIDATES:
                raise BadSdpFragment(f"more than {MAX_CANDIDATES} candidates")
            if not _has_name(line):
                candidates.append(FragmentCandidate(mid, line[2:]))
        elif line and line[1:2] != "=":
            raise BadSdpFragment("a line that is not SDP")
    return Fragment(username, password, candidates)


def _ice_chars(value: str, allowed: re.Pattern[str], before: str) -> str:
    """RFC 8839 5.4; all sections of a bundle have the same."""
    if not allowed.fullmatch(value) or before not in ("", value):
        raise BadSdpFragment("ice-ufrag or ice-pwd is not valid")
    return value


def format_fragment(username: str, password: str, kind: str, mid: str, candidates: Sequence[str]) -> str:
    """The answer to an ICE restart: our credentials, and all of our candidates ("candidate:...")."""
    lines = [f"a=ice-ufrag:{username}", f"a=ice-pwd:{password}", f"m={kind} 9 UDP/TLS/RTP/SAVPF 0", f"a=mid:{mid}"]
    return "\r\n".join([*lines, *(f"a={each}" for each in candidates), "a=end-of-candidates", ""])
