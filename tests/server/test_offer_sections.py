import asyncio

import pytest
from aiortc import RTCPeerConnection, RTCSessionDescription

from server.errors import BadSdp
from server.offer import prepare_offer
from server.offer_sections import AnswerableOffer, answerable
from tests.server.offers import offer, section

OPUS = section("1", "audio")
DATA = section("2", "application")


def video(codecs: str, mid: str = "0") -> str:
    """A video section with these `number name/rate` or further lines."""
    numbers = " ".join(line.split()[0] for line in codecs.splitlines() if not line.startswith("a="))
    lines = "".join(f"{line if line.startswith('a=') else f'a=rtpmap:{line}'}\r\n" for line in codecs.splitlines())
    return section(mid).replace("SAVPF 96", f"SAVPF {numbers}").replace("a=rtpmap:96 VP8/90000\r\n", lines)


async def answer_of(prepared: AnswerableOffer) -> str:
    pc = RTCPeerConnection()
    try:
        await pc.setRemoteDescription(RTCSessionDescription(prepared.text, "offer"))
        for transceiver in pc.getTransceivers():
            transceiver.direction = "inactive"
        await pc.setLocalDescription(await pc.createAnswer())
        return prepared.answer(pc.localDescription.sdp)
    finally:
        await pc.close()


def sections_of(text: str) -> list[list[str]]:
    return [part.splitlines() for part in text.split("m=")[1:]]


@pytest.mark.parametrize(
    "codecs",
    [
        "98 VP9/90000\na=fmtp:98 profile-id=0",
        "45 AV1/90000",
        "102 H264/90000\na=fmtp:102 level-asymmetry-allowed=1;packetization-mode=0;profile-level-id=42e01f",
        "102 H264/90000",
        "98 VP9/90000\n99 rtx/90000\na=fmtp:99 apt=98",
    ],
)
async def test_a_section_without_a_codec_in_common_is_rejected_and_the_others_are_answered(codecs: str) -> None:
    prepared = answerable(prepare_offer(offer(video(codecs), OPUS, DATA)))
    answer = await answer_of(prepared)
    rejected, opus, data = sections_of(answer)
    assert rejected[0].startswith("video 0 UDP/TLS/RTP/SAVPF ")
    assert rejected[0].split()[3:] == [line.split()[0] for line in codecs.splitlines() if not line.startswith("a=")]
    assert "a=inactive" in rejected
    assert "a=mid:0" in rejected
    assert not any(line.startswith("a=candidate") for line in rejected)
    assert "a=group:BUNDLE 1 2" in answer.splitlines()
    assert not opus[0].startswith("audio 0 ")
    assert not data[0].startswith("application 0 ")


async def test_a_rejected_section_in_the_middle_leaves_the_order_as_it_was() -> None:
    prepared = answerable(prepare_offer(offer(section("0"), video("98 VP9/90000", "1"), section("2", "audio"))))
    kinds = [part[0].split()[:2] for part in sections_of(await answer_of(prepared))]
    assert [kind for kind, _ in kinds] == ["video", "video", "audio"]
    assert [port == "0" for _, port in kinds] == [False, True, False]


def test_an_offer_that_has_nothing_in_common_is_refused_and_names_every_section() -> None:
    with pytest.raises(BadSdp, match="section 0: no codec in common; section 1: no codec in common"):
        answerable(prepare_offer(offer(video("98 VP9/90000"), video("45 AV1/90000", "1"))))


@pytest.mark.parametrize(("session", "meant"), [("", "a=sendrecv"), ("a=recvonly\r\n", "a=recvonly")])
async def test_a_section_without_a_direction_has_the_sessions_or_both(session: str, meant: str) -> None:
    text = offer(section("0").replace("a=recvonly\r\n", "")).replace("m=video", f"{session}m=video")
    prepared = answerable(prepare_offer(text))
    assert meant in sections_of(prepared.text)[0]
    assert sections_of(await answer_of(prepared))[0][0].startswith("video ")


async def test_a_static_payload_type_needs_no_mapping() -> None:
    text = offer(OPUS.replace("SAVPF 111", "SAVPF 0").replace("a=rtpmap:111 opus/48000/2\r\n", ""))
    prepared = answerable(prepare_offer(text))
    assert prepared.rejected == {}
    assert "a=rtpmap:0 PCMU/8000" in sections_of(await answer_of(prepared))[0]


async def test_the_peer_that_leaves_the_choice_opens_dtls_and_who_has_chosen_keeps_its_part() -> None:
    left = await answer_of(answerable(prepare_offer(offer(section("0")))))
    assert "a=setup:passive" in left.splitlines()
    chosen = await answer_of(answerable(prepare_offer(offer(section("0").replace("actpass", "passive")))))
    assert "a=setup:active" in chosen.splitlines()


async def test_an_answer_says_that_more_candidates_may_come() -> None:
    answer = await answer_of(answerable(prepare_offer(offer(section("0"), DATA))))
    assert "a=ice-options:trickle" in answer.split("m=")[0].splitlines()


async def test_what_is_rejected_costs_no_answer_of_many_sections() -> None:
    async with asyncio.timeout(20):
        many = [video("98 VP9/90000", str(number)) for number in range(15)]
        answer = await answer_of(answerable(prepare_offer(offer(*many, section("15", "application")))))
    assert answer.count("m=video 0 ") == 15
    assert "a=group:BUNDLE 15" in answer.splitlines()
