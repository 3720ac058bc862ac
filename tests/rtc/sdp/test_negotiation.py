from collections.abc import Sequence
from dataclasses import replace

import pytest

from lockstep.rtc.sdp import (
    MID_URI,
    Codec,
    Direction,
    LocalMedia,
    MediaSection,
    SdpError,
    SessionDescription,
    Setup,
    Source,
    SourceGroup,
    answer_to,
    both,
    check_answer,
    data_section,
    media_section,
    offer_of,
    parse_description,
    reverse,
    write_description,
)
from tests.rtc.sdp.samples import H264, NAMES, OPUS, RTX, TRANSPORT, VP8, everything, parsed, text_of

DIRECTIONS: Sequence[Direction] = ("sendrecv", "sendonly", "recvonly", "inactive")


@pytest.mark.parametrize("name", NAMES)
def test_the_offer_of_every_stack_is_answered_whole(name: str) -> None:
    offer = parsed(name)
    answer = answer_to(offer, TRANSPORT, everything(offer))
    check_answer(offer, answer)
    assert not any(section.rejected for section in answer.sections)
    assert answer.transport.setup == "passive"
    again = parse_description(write_description(answer))
    check_answer(offer, again)
    assert write_description(again) == write_description(answer)


def test_codecs_are_answered_in_our_order_with_the_offers_numbers() -> None:
    offer = parsed("chromium")
    answer = answer_to(offer, TRANSPORT, {"0": LocalMedia((VP8, H264, RTX)), "1": LocalMedia((OPUS,))}, data=False)
    video, audio, data = answer.sections
    assert [(codec.name, codec.payload_type) for codec in audio.codecs] == [("opus", 111)]
    assert video.codecs[0].payload_type == 96
    assert video.codecs[0].feedback == ("goog-remb", "nack", "nack pli")
    assert {codec.name for codec in video.codecs} == {"VP8", "H264", "rtx"}
    assert all(video.repair_of(codec) for codec in video.codecs if codec.name != "rtx")
    assert data.rejected


def test_without_our_retransmission_there_is_none() -> None:
    offer = parsed("chromium")
    video = answer_to(offer, TRANSPORT, {"0": LocalMedia((VP8,))}).sections[0]
    assert [codec.name for codec in video.codecs] == ["VP8"]


def test_streams_of_retransmissions_are_announced_where_there_are_any() -> None:
    offer = parse_description(text_of("chromium").replace("a=recvonly", "a=sendrecv"))
    streams = Source(7, {"cname": "x"}), Source(8, {"cname": "x"})
    own = LocalMedia((VP8, OPUS, RTX), sources=streams, source_groups=(SourceGroup("FID", (7, 8)),))
    video, audio, _ = answer_to(offer, TRANSPORT, {"0": own, "1": own}).sections
    assert (video.sources, video.repair_source(7)) == (streams, 8)
    assert (audio.sources, audio.source_groups) == (streams[:1], ())


def test_a_section_without_a_codec_in_common_is_inactive_and_the_others_are_answered() -> None:
    offer = parsed("chromium")
    answer = answer_to(offer, TRANSPORT, {"0": LocalMedia((Codec(96, "VP10", 90_000), RTX)), "1": LocalMedia((OPUS,))})
    lines = write_description(answer).split("m=")
    assert lines[1].startswith("video 0 UDP/TLS/RTP/SAVPF 96 97 102 ")
    assert "a=inactive\r\n" in lines[1]
    assert "a=mid:0\r\n" in lines[1]
    assert "a=group:BUNDLE 1 2\r\n" in lines[0]
    assert "a=candidate:" not in lines[1]
    assert "a=candidate:" in lines[2]
    check_answer(offer, parse_description(write_description(answer)))


def test_an_offer_with_nothing_in_common_is_refused() -> None:
    with pytest.raises(SdpError, match="section 0: no codec in common"):
        answer_to(parsed("janus"), TRANSPORT, {"0": LocalMedia((Codec(0, "PCMU", 8000),))})


def test_a_section_that_was_rejected_stays_so() -> None:
    text = text_of("janus").replace("m=audio 9", "m=audio 0").replace("BUNDLE 0 1", "BUNDLE 1")
    offer = parse_description(text)
    answer = answer_to(offer, TRANSPORT, everything(offer))
    assert [section.rejected for section in answer.sections] == [True, False]
    check_answer(offer, answer)


@pytest.mark.parametrize("offered", DIRECTIONS)
@pytest.mark.parametrize("wanted", DIRECTIONS)
def test_an_answer_goes_no_way_that_was_not_offered(offered: Direction, wanted: Direction) -> None:
    offer = parse_description(text_of("janus").replace("sendonly", offered))
    source = Source(7, {"cname": "x"})
    own = LocalMedia((H264, RTX), wanted, msid="a b", sources=(source,), source_groups=(SourceGroup("FID", (7, 8)),))
    video = answer_to(offer, TRANSPORT, {"1": own}).sections[1]
    assert video.direction == both(reverse(offered), wanted)
    sends = video.direction in ("sendrecv", "sendonly")
    assert bool(video.sources) is bool(video.msid) is bool(video.source_groups) is sends


def test_the_ways_add_up() -> None:
    assert [reverse(each) for each in DIRECTIONS] == ["sendrecv", "recvonly", "sendonly", "inactive"]
    assert both("sendonly", "recvonly") == "inactive"
    assert both("sendrecv", "recvonly") == "recvonly"


@pytest.mark.parametrize(
    ("offered", "preferred", "chosen"),
    [
        ("actpass", "passive", "passive"),
        ("actpass", "active", "active"),
        ("active", "active", "passive"),
        ("passive", "passive", "active"),
    ],
)
def test_who_opens_dtls_is_chosen_where_the_offer_leaves_it(offered: str, preferred: Setup, chosen: str) -> None:
    offer = parse_description(text_of("janus").replace("a=setup:actpass", f"a=setup:{offered}"))
    answer = answer_to(offer, replace(TRANSPORT, setup=preferred), everything(offer))
    assert answer.transport.setup == chosen


def test_header_extensions_have_the_offers_ids_and_chosen_ones_are_the_same_everywhere() -> None:
    offer = parsed("gstreamer")
    video, audio, _ = answer_to(offer, TRANSPORT, everything(offer)).sections
    assert {each.uri: each.id for each in video.extensions} == {MID_URI: 1, "urn:to:be:chosen": 2}
    assert {each.uri: each.id for each in audio.extensions} == {"urn:to:be:chosen": 2}


def test_only_header_extensions_that_we_have_are_answered_and_their_way_is_turned() -> None:
    offer = parsed("firefox")
    delay = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay"
    answer = answer_to(offer, TRANSPORT, {"0": LocalMedia((VP8,), "sendonly", (delay,))})
    assert [(each.id, each.direction) for each in answer.sections[0].extensions] == [(6, "sendonly")]


def test_an_offer_that_leaves_more_ids_to_us_than_there_are_is_refused() -> None:
    lines = "".join(f"a=extmap:{4096 + x} urn:{x}\r\n" for x in range(255))
    with pytest.raises(SdpError, match="more than 255"):
        answer_to(parse_description(text_of("janus") + lines), TRANSPORT, {})


@pytest.mark.parametrize(
    ("parameters", "same"),
    [
        ({"packetization-mode": "1", "profile-level-id": "42e01f"}, True),
        ({"packetization-mode": "1", "profile-level-id": "42E034"}, True),  # another level
        ({"packetization-mode": "1", "profile-level-id": "4d801f"}, True),  # constrained baseline as well
        ({"packetization-mode": "1", "profile-level-id": "58c01f"}, True),
        ({"packetization-mode": "1", "profile-level-id": "58801f"}, False),  # baseline
        ({"packetization-mode": "1", "profile-level-id": "42001f"}, False),
        ({"packetization-mode": "1", "profile-level-id": "4d001f"}, False),
        ({"packetization-mode": "1", "profile-level-id": "640c1f"}, False),
        ({"packetization-mode": "1", "profile-level-id": "nonsense"}, False),
        ({"packetization-mode": "0", "profile-level-id": "42e01f"}, False),
        ({"profile-level-id": "42e01f"}, False),
        ({}, False),
    ],
)
def test_h264_is_the_same_when_profile_and_packetization_mode_are(parameters: dict[str, str], same: bool) -> None:
    offer = parsed("janus")
    video = replace(offer.sections[1], codecs=(Codec(96, "h264", 90_000, parameters=parameters),))
    offer = replace(offer, sections=(offer.sections[0], video))
    answer = answer_to(offer, TRANSPORT, {"0": LocalMedia((OPUS,)), "1": LocalMedia((H264,))})
    assert answer.sections[1].rejected is not same
    if same:
        assert answer.sections[1].codecs[0].parameters == parameters  # the format is the offer's


def ours() -> SessionDescription:
    ids = {MID_URI: 1, "urn:stamp": 2}
    camera = LocalMedia((VP8, Codec(97, "rtx", 90_000, parameters={"apt": "96"})), "sendonly", tuple(ids))
    sections = [media_section("0", "video", camera, ids), data_section("1", 262_144)]
    return offer_of(sections, TRANSPORT, session_id=5)


def test_our_offer_leaves_who_opens_dtls_and_is_answered_by_ourselves() -> None:
    offer = parse_description(write_description(ours()))
    assert offer.transport.setup == "actpass"
    assert offer.sections[1].max_message_size == 262_144
    answer = answer_to(offer, TRANSPORT, everything(offer))
    check_answer(ours(), parse_description(write_description(answer)))
    video = answer.sections[0]
    assert video.direction == "recvonly"
    assert [codec.payload_type for codec in video.codecs] == [96, 97]
    assert {each.uri: each.id for each in video.extensions} == {MID_URI: 1, "urn:stamp": 2}


def changed(**changes: object) -> SessionDescription:
    offer = ours()
    answer = answer_to(offer, TRANSPORT, everything(offer))
    video = replace(answer.sections[0], **changes)  # type: ignore[arg-type]
    return replace(answer, sections=(video, answer.sections[1]))


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (changed(mid="2"), "stands where"),
        (changed(kind="audio"), "stands where"),
        (changed(direction="sendrecv"), "does not answer"),
        (changed(codecs=(OPUS,)), "opus was not offered"),
        (changed(codecs=()), "no codec"),
        (changed(extensions=parsed("janus").sections[0].extensions), "header extension 4"),
    ],
)
def test_an_answer_to_another_offer_is_refused_with_its_section(answer: SessionDescription, reason: str) -> None:
    with pytest.raises(SdpError, match=reason) as refused:
        check_answer(ours(), answer)
    assert refused.value.section == answer.sections[0].mid


def test_an_answer_with_too_few_sections_or_without_a_choice_is_refused() -> None:
    answer = changed()
    with pytest.raises(SdpError, match="1 sections for the offer's 2"):
        check_answer(ours(), replace(answer, sections=answer.sections[:1]))
    with pytest.raises(SdpError, match="active or passive"):
        check_answer(ours(), replace(answer, transport=replace(answer.transport, setup="actpass")))


def test_an_answer_may_reject_a_section_but_not_take_a_rejected_one() -> None:
    answer = changed()
    without = answer_to(ours(), TRANSPORT, {})
    assert without.sections[0].rejected
    check_answer(ours(), without)
    offer: SessionDescription = replace(ours(), sections=without.sections)
    with pytest.raises(SdpError, match="was not offered"):
        check_answer(offer, answer)


def test_a_section_knows_its_kind() -> None:
    assert MediaSection("audio", "0").is_media
    assert not MediaSection("application", "0").is_media
