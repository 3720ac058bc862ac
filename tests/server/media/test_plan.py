"""What an offer is answered, section by section, and what a relay is offered."""

import pytest

from lockstep.rtc.endpoint import Endpoint
from lockstep.rtc.sdp import SdpError, SessionDescription
from lockstep.server.media.planning import codec_in_use
from lockstep.server.webrtc.sdp_offer import parse_offer
from tests.server.media.pipeline.collecting import Counted
from tests.server.media.viewer import description, running_plane
from tests.server.offers import offer, section

OPUS = section("1", "audio")
DATA = section("2", "application")


def video(codecs: str, mid: str = "0") -> str:
    """`codecs`: "98 VP9/90000", each with the further lines that it has."""
    lines = codecs.splitlines()
    numbers = " ".join(line.split()[0] for line in lines if not line.startswith("a="))
    mapped = "".join(f"{line}\r\n" if line.startswith("a=") else f"a=rtpmap:{line}\r\n" for line in lines)
    return section(mid).replace("SAVPF 96", f"SAVPF {numbers}").replace("a=rtpmap:96 VP8/90000\r\n", mapped)


async def answered(text: str, *, cameras: int = 1) -> SessionDescription:
    async with running_plane(description(cameras=cameras)) as hub, Endpoint(["127.0.0.1"]) as endpoint:
        found = parse_offer(text)
        return endpoint.connect(controlling=False).answer(found, hub.plan(found, trailer=False).media)


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
    rejected, opus, data = (await answered(offer(video(codecs), OPUS, DATA))).sections
    assert (rejected.rejected, rejected.mid, opus.rejected, data.rejected) == (True, "0", False, False)
    assert rejected.formats == tuple(line.split()[0] for line in codecs.splitlines() if not line.startswith("a="))
    assert opus.direction == "sendonly"


@pytest.mark.parametrize(("old", "new"), [("m=video", "m=smell"), ("96 VP8/90000", "VP8")])
async def test_a_section_that_nobody_understands_is_rejected_and_the_others_are_answered(old: str, new: str) -> None:
    strange, opus = (await answered(offer(section("0").replace(old, new), OPUS))).sections
    assert (strange.rejected, opus.rejected) == (True, False)


async def test_a_rejected_section_in_the_middle_leaves_the_order_as_it_was() -> None:
    text = offer(section("0"), video("98 VP9/90000", "1"), OPUS.replace("mid:1", "mid:2"))
    found = (await answered(text)).sections
    assert [(each.kind, each.rejected) for each in found] == [("video", False), ("video", True), ("audio", False)]


async def test_an_offer_that_has_nothing_in_common_is_refused_and_names_every_section() -> None:
    with pytest.raises(SdpError, match="section 0: no codec in common; section 1: no codec in common"):
        await answered(offer(video("98 VP9/90000"), video("45 AV1/90000", "1")))


@pytest.mark.parametrize(("session", "sends"), [("", True), ("a=recvonly\r\n", True), ("a=inactive\r\n", False)])
async def test_a_section_without_a_direction_has_the_sessions_or_both(session: str, sends: bool) -> None:
    text = offer(section("0").replace("a=recvonly\r\n", "")).replace("m=video", f"{session}m=video")
    (found,) = (await answered(text)).sections
    assert found.direction == ("sendonly" if sends else "inactive")


async def test_a_static_payload_type_needs_no_mapping() -> None:
    text = offer(OPUS.replace("SAVPF 111", "SAVPF 0").replace("a=rtpmap:111 opus/48000/2\r\n", ""))
    (found,) = (await answered(text)).sections
    assert [(each.payload_type, each.name) for each in found.codecs] == [(0, "PCMU")]


@pytest.mark.parametrize(("number", "name"), [(8, "PCMA"), (9, "G722")])
async def test_sound_that_the_console_knows_and_does_not_send_is_answered_inactive(number: int, name: str) -> None:
    named = OPUS.replace("a=rtpmap:111 opus/48000/2", f"a=rtpmap:{number} {name}/8000")
    (found,) = (await answered(offer(named.replace("SAVPF 111", f"SAVPF {number}")))).sections
    assert (found.rejected, found.direction) == (False, "inactive")


async def test_the_peer_that_leaves_the_choice_opens_dtls_and_who_has_chosen_keeps_its_part() -> None:
    assert (await answered(offer(section("0")))).transport.setup == "passive"
    assert (await answered(offer(section("0").replace("actpass", "passive")))).transport.setup == "active"


async def test_an_answer_says_that_more_candidates_may_come() -> None:
    assert "trickle" in (await answered(offer(section("0"), DATA))).transport.ice_options


async def test_the_channels_that_an_offer_names_are_named_in_the_answer() -> None:
    named = '0 label="control";ordered=false;max-retr=0'
    _, data = (await answered(offer(section("0"), DATA + f"a=dcmap:{named}\r\n"))).sections
    assert data.channel_maps == (named,)


async def test_an_extension_whose_id_fits_no_packet_is_left_out_and_one_that_is_left_to_us_gets_one() -> None:
    uri = "urn:x-lockstep:rtp-hdrext:event-reference"
    for number, ids in ((7, [7]), (256, []), (4352, []), (4096, [1])):
        (found,) = (await answered(offer(section("0", extra=f"a=extmap:{number} {uri}\r\n")))).sections
        assert [each.id for each in found.extensions] == ids, number


def test_a_relay_is_offered_a_codec_in_use_and_never_the_name_of_the_cameras_own_encoding() -> None:
    counted = Counted()
    encodings = counted.encodings("H264", "VP8")
    encodings.add_passed().targets[counted.subscription()] = None
    assert codec_in_use(encodings) == "H264"
    encodings.join("VP8", counted.subscription())
    assert codec_in_use(encodings) == "VP8"
    assert codec_in_use(encodings, "H264") == "H264"
    assert codec_in_use(encodings, "AV1") == "VP8"
