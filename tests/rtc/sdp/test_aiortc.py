"""What aiortc makes of our descriptions, and we of its."""

from aiortc import RTCPeerConnection, RTCSessionDescription

from lockstep.rtc.sdp import (
    LocalMedia,
    answer_to,
    check_answer,
    data_section,
    media_section,
    offer_of,
    parse_description,
    write_description,
)
from tests.rtc.sdp.samples import H264, OPUS, RTX, TRANSPORT, VP8


async def test_aiortc_answers_our_offer() -> None:
    camera = LocalMedia((VP8,), "sendonly", ("urn:ietf:params:rtp-hdrext:sdes:mid",))
    ids = {"urn:ietf:params:rtp-hdrext:sdes:mid": 3}
    sections = [
        media_section("camera", "video", camera, ids),
        media_section("microphone", "audio", LocalMedia((OPUS,)), ids),
        data_section("data"),
    ]
    offer = offer_of(sections, TRANSPORT)
    pc = RTCPeerConnection()
    try:
        await pc.setRemoteDescription(RTCSessionDescription(write_description(offer), "offer"))
        await pc.setLocalDescription(await pc.createAnswer())
        answer = parse_description(pc.localDescription.sdp)
        check_answer(offer, answer)
        assert [section.direction for section in answer.sections[:2]] == ["recvonly", "recvonly"]
    finally:
        await pc.close()


async def test_we_answer_aiortcs_offer_and_it_takes_the_answer() -> None:
    pc = RTCPeerConnection()
    try:
        pc.addTransceiver("video", "recvonly")
        pc.addTransceiver("audio", "recvonly")
        pc.createDataChannel("x")
        await pc.setLocalDescription(await pc.createOffer())
        offer = parse_description(pc.localDescription.sdp)
        media = LocalMedia((VP8, H264, OPUS, RTX), "sendonly")
        answer = answer_to(offer, TRANSPORT, {section.mid: media for section in offer.sections})
        check_answer(offer, answer)
        await pc.setRemoteDescription(RTCSessionDescription(write_description(answer), "answer"))
        assert [each.currentDirection for each in pc.getTransceivers()] == ["recvonly", "recvonly"]
    finally:
        await pc.close()
