"""What the session descriptions of `rtc/` must withstand: only SdpError comes out, and what is read can be written."""

from lockstep.rtc.sdp import (
    LocalMedia,
    SdpError,
    answer_to,
    check_answer,
    parse_description,
    parse_fragment,
    write_description,
)
from tests.rtc.sdp.samples import H264, OPUS, RTX, TRANSPORT, VP8

__all__ = ["try_input"]


def offer(text: str) -> None:
    try:
        found = parse_description(text)
    except SdpError:
        return
    again = parse_description(write_description(found))
    if write_description(again) != write_description(found):
        raise AssertionError("a description changes when it is read again")
    media = LocalMedia((VP8, H264, OPUS, RTX), extensions=[each.uri for x in found.sections for each in x.extensions])
    try:
        answer = answer_to(found, TRANSPORT, {section.mid: media for section in found.sections})
    except SdpError:
        return
    check_answer(found, parse_description(write_description(answer)))


def fragment(text: str) -> None:
    try:
        parse_fragment(text, "0")
    except SdpError:
        return


def try_input(data: bytes) -> None:
    """The first byte chooses. Raises whatever goes wrong."""
    scene = fragment if data[:1] == b"1" else offer
    scene(data[1:].decode(errors="replace"))
