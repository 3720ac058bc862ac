"""The console as the offering side: one codec a section, and the extensions that a relay hands on."""

import pytest
from aiortc import RTCPeerConnection

from robot_bridge.protocol.carriers import PLAYOUT_DELAY_URI
from server.media.header_extensions import MID_URI
from server.media.publishing_private import (
    PLAYOUT_DELAY_ID,
    ask_for_no_delay,
    keep_answered_extensions,
    offer_section,
)


@pytest.mark.parametrize(("kind", "codec"), [("video", "H264"), ("video", "VP8"), ("audio", "opus"), ("audio", "PCMU")])
async def test_a_section_offers_one_codec_which_is_known_before_the_offer(kind: str, codec: str) -> None:
    pc = RTCPeerConnection()
    transceiver = offer_section(pc, kind, codec)
    decided = [each.name for each in transceiver._codecs]
    offer = await pc.createOffer()
    await pc.close()
    assert decided == [codec]
    assert [line for line in offer.sdp.splitlines() if line.startswith("a=rtpmap:")][0].split(" ")[1].startswith(codec)
    assert sum(line.startswith("a=rtpmap:") for line in offer.sdp.splitlines()) == 1


async def test_a_codec_that_is_not_there_is_refused() -> None:
    pc = RTCPeerConnection()
    with pytest.raises(ValueError, match="no video codec AV1"):
        offer_section(pc, "video", "AV1")
    await pc.close()


def test_no_delay_is_asked_for_in_video_sections_alone() -> None:
    sdp = "m=video 9 X 96\r\na=mid:0\r\nm=audio 9 X 97\r\na=mid:1\r\nm=application 9 X y\r\na=mid:2\r\n"
    lines = ask_for_no_delay(sdp).splitlines()
    assert [line for line in lines if "extmap" in line] == [f"a=extmap:{PLAYOUT_DELAY_ID} {PLAYOUT_DELAY_URI}"]
    assert lines[2].startswith("a=extmap:")


async def test_extensions_are_sent_as_they_were_answered_and_no_others() -> None:
    pc = RTCPeerConnection()
    transceiver = offer_section(pc, "video", "VP8")
    transceiver._set_mid("0")
    answer = (
        f"m=video 9 X 96\r\na=mid:0\r\na=extmap:4 {MID_URI}\r\na=extmap:12 {PLAYOUT_DELAY_URI}\r\na=extmap:5 urn:x\r\n"
    )
    keep_answered_extensions(pc, answer)
    await pc.close()
    assert {each.uri: each.id for each in transceiver._headerExtensions} == {MID_URI: 4, PLAYOUT_DELAY_URI: 12}
