"""Parses WHEP and WHIP offers, and the fragments that follow them, within the console's bounds. No I/O."""

from dataclasses import replace

from lockstep.rtc.ice.candidates import CandidateError, parse_candidate
from lockstep.rtc.sdp import Fragment, SdpError, SessionDescription, parse_description
from lockstep.rtc.sdp import parse_fragment as parse_any_fragment
from lockstep.server.errors import BadSdp, BadSdpFragment, TooManySections

__all__ = ["MAX_CANDIDATES", "MAX_SECTIONS", "parse_fragment", "parse_offer"]

MAX_SECTIONS = 16  # media sections, of a robot with fewer streams; each costs the event loop a millisecond
MAX_CANDIDATES = 100  # of the peer, in one session


def parse_offer(text: str, max_sections: int = MAX_SECTIONS) -> SessionDescription:
    """Parse an offer.

    Raises:
        TooManySections: more than `max_sections`.
        BadSdp: not an offer that can be answered.
    """
    if sum(line.startswith("m=") for line in text.splitlines()) > max_sections:  # before it costs anything
        raise TooManySections(f"the offer has more than {max_sections} media sections")
    try:
        return parse_description(text)
    except SdpError as error:
        raise BadSdp(str(error)) from error


def parse_fragment(text: str, first_mid: str) -> Fragment:
    """Parse a fragment (RFC 8840 9).

    Candidates with names are left out: the peer connects to the console, so its checks show its address (RFC 8445
    7.3.1.3), and resolving its `.local` names would cost a second of multicast.

    Args:
        first_mid: for lines before the first media section; with BUNDLE all candidates are for it

    Raises:
        BadSdpFragment: not a fragment, or a candidate that is not valid.
    """
    try:
        fragment = parse_any_fragment(text, first_mid)
        usable = tuple(each for each in fragment.candidates if parse_candidate(each.line).is_ip_address)
    except (SdpError, CandidateError) as error:
        raise BadSdpFragment(str(error)) from error
    return replace(fragment, candidates=usable)
