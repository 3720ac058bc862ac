import pytest
from aiortc import RTCBundlePolicy, RTCConfiguration, RTCPeerConnection
from hypothesis import given
from hypothesis import strategies as st

from client.sdp import KEPT_EXTENSIONS, offer_extension, read_sections, replace_candidates
from robot_bridge.protocol.carriers import EVENT_REFERENCE_URI


@pytest.fixture
async def offer() -> str:
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[], bundlePolicy=RTCBundlePolicy.MAX_BUNDLE))
    pc.addTransceiver("video", direction="recvonly")
    pc.addTransceiver("audio", direction="recvonly")
    pc.createDataChannel("control")
    sdp: str = (await pc.createOffer()).sdp
    await pc.close()
    return sdp


async def test_the_offer_has_the_chosen_extension_in_every_media_section_and_no_foreign_one(offer: str) -> None:
    foreign = offer.replace("a=mid:", "a=extmap:9 urn:somebody:else\r\na=mid:")
    sections = read_sections(offer_extension(foreign, EVENT_REFERENCE_URI))
    assert [section.kind for section in sections] == ["video", "audio", "application"]
    ids = {section.extensions.get(EVENT_REFERENCE_URI) for section in sections if section.kind != "application"}
    assert len(ids) == 1
    assert None not in ids
    offered = {uri for section in sections for uri in section.extensions}
    assert offered <= KEPT_EXTENSIONS | {EVENT_REFERENCE_URI}
    assert not sections[2].extensions


async def test_the_extension_takes_an_id_that_nobody_has(offer: str) -> None:
    for section in read_sections(offer_extension(offer, EVENT_REFERENCE_URI))[:2]:
        assert len(set(section.extensions.values())) == len(section.extensions)


async def test_without_a_uri_nothing_is_added(offer: str) -> None:
    offered = {uri for section in read_sections(offer_extension(offer, None)) for uri in section.extensions}
    assert offered <= KEPT_EXTENSIONS


def test_an_answer_is_read() -> None:
    sdp = "\r\n".join(
        [
            "v=0",
            "m=video 9 UDP/TLS/RTP/SAVPF 97 98",
            "a=sendonly",
            "a=extmap:4/sendonly urn:x",
            "a=mid:0",
            "a=msid:front 77",
            "a=rtpmap:97 VP8/90000",
            "a=ssrc:11 cname:a",
            "a=ssrc:11 msid:front",
            "a=ssrc:12 cname:a",
            "m=audio 0 UDP/TLS/RTP/SAVPF 0",
            "a=inactive",
            "a=mid:1",
            "",
        ]
    )
    video, audio = read_sections(sdp)
    assert (video.mid, video.stream, video.receives) == ("0", "front", True)
    assert (video.codecs, video.extensions, video.ssrcs) == ({97: "VP8"}, {"urn:x": 4}, [11, 12])
    assert (audio.kind, audio.mid, audio.receives) == ("audio", "1", False)


def test_each_section_gets_the_relay_as_its_only_candidate() -> None:
    sdp = (
        "m=audio 1 X\r\na=candidate:1 1 udp 5 10.0.0.1 4000 typ host\r\n"
        "a=candidate:2 1 udp 4 10.0.0.2 4000 typ host\r\n"
        "a=end-of-candidates\r\nm=video 1 X\r\na=candidate:1 1 UDP 5 10.0.0.1 4000 typ host\r\n"
    )
    lines = replace_candidates(sdp, "127.0.0.1", 5).splitlines()
    assert lines.count("a=candidate:1 1 udp 5 127.0.0.1 5 typ host") == 2
    assert sum(line.startswith("a=candidate:") for line in lines) == 2
    assert "a=end-of-candidates" in lines


@given(
    st.lists(st.sampled_from(["m=audio", "m=", "a=mid:", "a=msid:", "a=rtpmap:1 ", "a=extmap:", "a=ssrc:"]) | st.text())
)
def test_no_text_raises(lines: list[str]) -> None:
    text = "\r\n".join(lines)
    read_sections(text)
    replace_candidates(text, "127.0.0.1", 1)
