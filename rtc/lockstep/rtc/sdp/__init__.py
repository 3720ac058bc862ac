"""Session descriptions of one BUNDLE: from text to data, from data to text, and the negotiation of offer and answer."""

from lockstep.rtc.sdp.codecs import common_codecs, is_same_format
from lockstep.rtc.sdp.description import (
    MID_URI,
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
    reverse,
)
from lockstep.rtc.sdp.errors import SdpError
from lockstep.rtc.sdp.fragment import Fragment, FragmentCandidate, parse_fragment, write_fragment
from lockstep.rtc.sdp.negotiation import LocalMedia, answer_to, check_answer, data_section, media_section, offer_of
from lockstep.rtc.sdp.parse import SdpLimits, parse_description
from lockstep.rtc.sdp.write import write_description

__all__ = [
    "MID_URI",
    "Codec",
    "Direction",
    "Fragment",
    "FragmentCandidate",
    "HeaderExtension",
    "LocalMedia",
    "MediaSection",
    "SdpError",
    "SdpLimits",
    "SessionDescription",
    "Setup",
    "Source",
    "SourceGroup",
    "Transport",
    "answer_to",
    "both",
    "check_answer",
    "common_codecs",
    "data_section",
    "is_same_format",
    "media_section",
    "offer_of",
    "parse_description",
    "parse_fragment",
    "reverse",
    "write_description",
    "write_fragment",
]
