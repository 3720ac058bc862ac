import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.sdp import SdpError, SdpLimits, Source, SourceGroup, parse_description, write_description
from tests.rtc.sdp.samples import NAMES, parsed, text_of

GOOD = text_of("janus")


@pytest.mark.parametrize("name", NAMES)
def test_the_offer_of_every_stack_is_read_and_written_again(name: str) -> None:
    offer = parsed(name)
    written = write_description(offer)
    assert write_description(parse_description(written)) == written
    assert [section.mid for section in offer.accepted] == [section.mid for section in offer.sections]
    assert offer.transport.setup == "actpass"


def test_what_chromium_says_is_all_there() -> None:
    offer = parsed("chromium")
    video, audio, data = offer.sections
    assert (video.kind, audio.kind, data.kind) == ("video", "audio", "application")
    assert (video.direction, audio.direction) == ("sendrecv", "recvonly")
    assert offer.allow_mixed
    assert offer.session_id == 4266471454027468370
    assert offer.transport.ice_options == ("trickle",)
    vp8 = video.codecs[0]
    assert (vp8.payload_type, vp8.name, vp8.clock_rate) == (96, "VP8", 90_000)
    assert vp8.feedback == ("goog-remb", "transport-cc", "ccm fir", "nack", "nack pli")
    repair = video.repair_of(vp8)
    assert repair is not None
    assert (repair.payload_type, repair.repairs) == (97, 96)
    assert video.extension_id("urn:ietf:params:rtp-hdrext:sdes:mid") == 9
    assert video.extension_id("urn:x") is None
    assert audio.codecs[0].channels == 2
    assert data.sctp_port == 5000
    assert data.max_message_size == 262144


def test_a_section_with_port_0_that_is_bundle_only_is_not_rejected() -> None:
    assert [section.rejected for section in parsed("firefox").sections] == [False, False, False]
    text = text_of("firefox").replace("a=bundle-only\r\n", "", 1).replace("BUNDLE 0 1 2", "BUNDLE 0 2")
    assert [section.rejected for section in parse_description(text).sections] == [False, True, False]


def test_what_the_session_says_is_for_every_section_that_says_nothing() -> None:
    offer = parsed("libdatachannel")
    assert offer.transport.ufrag == "7Wp+"
    assert offer.transport.fingerprints == (Fingerprint("sha-256", ":".join(["AB"] * 32)),)
    assert offer.transport.end_of_candidates
    assert len(offer.transport.candidates) == 2
    assert offer.transport.candidates[0].startswith("candidate:1 1 UDP ")


def test_streams_and_their_retransmissions_are_read() -> None:
    video = parsed("janus").sections[1]
    assert video.sources == (Source(2222222222, {"cname": "janus"}), Source(3333333333, {"cname": "janus"}))
    assert video.source_groups == (SourceGroup("FID", (2222222222, 3333333333)),)
    assert video.repair_source(2222222222) == 3333333333
    assert video.repair_source(3333333333) is None
    assert video.msid == "janus janus1"


@pytest.mark.parametrize("replaced", ["", "a=sendrecv"])
def test_no_direction_means_both(replaced: str) -> None:
    assert parse_description(GOOD.replace("a=sendonly", replaced)).sections[0].direction == "sendrecv"


def test_a_direction_of_the_session_is_for_sections_without_one() -> None:
    text = GOOD.replace("a=sendonly\r\n", "", 1).replace("t=0 0\r\n", "t=0 0\r\na=recvonly\r\n")
    assert [section.direction for section in parse_description(text).sections] == ["recvonly", "sendonly"]


def test_header_extensions_that_no_packet_can_carry_are_left_out() -> None:
    ids = {each.uri: each.id for each in parsed("gstreamer").sections[0].extensions}
    assert ids == {"urn:ietf:params:rtp-hdrext:sdes:mid": 1, "urn:to:be:chosen": 4096}
    for number, taken in ((0, False), (14, True), (15, True), (255, True), (256, False), (4095, False), (4352, False)):
        video = parse_description(GOOD.replace("extmap:4 ", f"extmap:{number} ")).sections[1]
        assert [each.id for each in video.extensions] == ([number] if taken else [])


def test_static_payload_types_need_no_mapping() -> None:
    text = GOOD.replace("SAVPF 111", "SAVPF 0 8 9 3 77 111")
    assert [codec.name for codec in parse_description(text).sections[0].codecs] == ["PCMU", "PCMA", "G722", "opus"]


def test_payload_types_that_look_like_rtcp_are_left_out() -> None:
    text = GOOD.replace("SAVPF 111", "SAVPF 72 111").replace("a=rtpmap:111", "a=rtpmap:72 opus/48000/2\r\na=rtpmap:111")
    assert [codec.payload_type for codec in parse_description(text).sections[0].codecs] == [111]


def test_feedback_of_all_codecs_is_each_codecs() -> None:
    video = parse_description(GOOD.replace("a=rtcp-fb:96 ccm fir", "a=rtcp-fb:* ccm fir")).sections[1]
    assert [codec.feedback for codec in video.codecs] == [("nack", "nack pli", "goog-remb", "ccm fir"), ("ccm fir",)]


@pytest.mark.parametrize(
    ("old", "new", "section", "reason"),
    [
        ("v=0", "v=1", None, "does not begin"),
        ("t=0 0", "t=0 0\r\nhello", None, "not SDP"),
        ("t=0 0", "t=0 \x000", None, "not SDP"),
        ("BUNDLE 0 1", "BUNDLE 0", "1", "BUNDLE"),
        ("BUNDLE 0 1", "LS 0 1", None, "BUNDLE"),
        ("BUNDLE 0 1", "BUNDLE 0 1 2", None, "not there"),
        ("BUNDLE 0 1", "BUNDLE 0 1 1", None, "BUNDLE"),
        ("a=mid:1", "a=mid:0", "0", "another section's"),
        ("a=mid:0\r\n", "", "#0", "mid"),
        ("a=rtcp-mux\r\n", "", "0", "rtcp-mux"),
        ("a=ice-ufrag:Jn4s\r\n", "", "0", "ice-ufrag"),
        ("a=ice-ufrag:Jn4s", "a=ice-ufrag:J 4s", "0", "ice-ufrag"),
        ("a=ice-pwd:0123456789abcdefghijkl", "a=ice-pwd:short", "0", "ice-pwd"),
        ("a=setup:actpass", "a=setup:holdconn", "0", "setup"),
        ("a=setup:actpass\r\n", "", "0", "setup"),
        ("a=fingerprint:sha-256 AB:", "a=fingerprint:sha-256 zz:", "0", "fingerprint"),
        ("a=fingerprint:sha-256 AB:", "a=fingerprint:sha-256 ", "0", "fingerprint"),
        ("a=fingerprint:", "a=x:", "0", "fingerprint"),
        ("m=audio 9", "m=audio nine", "0", "m= line"),
        ("SAVPF 111", "SAVPF", "0", "m= line"),
        ("SAVPF 111", "SAVPF 111 128", "0", "payload type 128"),
        ("SAVPF 111", "SAVPF 111 ²", "0", "payload type"),
        ("opus/48000/2", "opus", "0", "rtpmap:111"),
        ("opus/48000/2", "opus/0", "0", "rtpmap:111"),
        ("a=extmap:4 ", "a=extmap:x ", "0", "header extension"),
        ("a=extmap:4 urn", "a=extmap:4 urn:x\r\na=extmap:4 urn", "0", "two header extensions with the id 4"),
        ("a=ssrc:1111111111 ", "a=ssrc:x ", "0", "source"),
        ("a=ssrc:1111111111 ", "a=ssrc:4294967296 ", "0", "source"),
        ("a=ssrc-group:FID 2222222222", "a=ssrc-group:FID x", "1", "source"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused_with_section_and_reason(
    old: str, new: str, section: str | None, reason: str
) -> None:
    assert old in GOOD
    with pytest.raises(SdpError, match=reason) as refused:
        parse_description(GOOD.replace(old, new))
    assert refused.value.section == section
    assert str(refused.value) == (
        refused.value.reason if section is None else f"section {section}: {refused.value.reason}"
    )


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("a=sctp-port:5000\r\n", "", "sctp-port"),
        ("a=sctp-port:5000", "a=sctp-port:65536", "sctp-port"),
        ("a=max-message-size:65536", "a=max-message-size:-1", "max-message-size"),
    ],
)
def test_data_channels_without_what_they_need_are_refused(old: str, new: str, reason: str) -> None:
    with pytest.raises(SdpError, match=reason) as refused:
        parse_description(text_of("werift").replace(old, new))
    assert refused.value.section == "1"


def test_two_sections_of_data_channels_are_refused() -> None:
    head, section = text_of("werift").split("m=application")
    text = f"{head}m=application{section}m=application{section}".replace("BUNDLE 0 1", "BUNDLE 0 1 2")
    with pytest.raises(SdpError, match="second"):
        parse_description(text[::-1].replace("a=mid:1"[::-1], "a=mid:2"[::-1], 1)[::-1])


def test_what_a_peer_may_make_us_read_is_bounded() -> None:
    candidate = "a=candidate:1 1 udp 1 192.0.2.20 41000 typ host\r\n"
    for old, new, limits in (
        ("", "", SdpLimits(text=100)),
        ("", "", SdpLimits(sections=1)),
        ("a=end-of-candidates", candidate * 101, SdpLimits()),
        ("a=ssrc:1111111111 ", "".join(f"a=ssrc:{x} cname:x\r\n" for x in range(65)) + "a=ssrc:99 ", SdpLimits()),
        ("a=ssrc-group:", "a=ssrc-group:FID 1 2\r\n" * 64 + "a=ssrc-group:", SdpLimits()),
        ("a=fingerprint:", f"a=fingerprint:sha-1 {'AB:' * 19}AB\r\n" * 16 + "a=fingerprint:", SdpLimits()),
    ):
        with pytest.raises(SdpError, match="more than|at most"):
            parse_description(GOOD.replace(old, new) if old else GOOD, limits)


def test_kinds_of_sections_that_nobody_here_knows_are_read_for_their_rejection() -> None:
    text = GOOD + "m=text 9 UDP/TLS/RTP/SAVPF 99\r\na=mid:2\r\nm=audio 9 TCP/MSRP *\r\na=mid:3\r\n"
    offer = parse_description(text.replace("BUNDLE 0 1", "BUNDLE 0 1 2 3"))
    assert [section.codecs for section in offer.sections[2:]] == [(), ()]


@given(st.text())
def test_no_text_raises_anything_else(text: str) -> None:
    with pytest.raises(SdpError):
        parse_description(text)


@given(
    st.sampled_from(NAMES),
    st.lists(st.tuples(st.floats(0, 1), st.integers(0, 30), st.text(max_size=8)), min_size=1, max_size=4),
)
def test_no_mutation_raises_anything_else_and_what_is_read_can_be_written(
    name: str, cuts: list[tuple[float, int, str]]
) -> None:
    text = text_of(name)
    for place, length, instead in cuts:
        start = int(place * len(text))
        text = text[:start] + instead + text[start + length :]
    try:
        description = parse_description(text)
    except SdpError:
        return
    written = write_description(description)
    assert write_description(parse_description(written)) == written


def test_channels_that_need_no_opening_message_are_kept_as_they_are_written() -> None:
    maps = ('0 label="control";ordered=false;max-retr=0', '1 label="session"')
    lines = "".join(f"a=dcmap:{each}\r\n" for each in maps)
    text = text_of("werift").replace("a=sctp-port:5000\r\n", f"a=sctp-port:5000\r\n{lines}")
    found = parse_description(text)
    (data,) = (each for each in found.sections if each.sctp_port is not None)
    assert data.channel_maps == maps
    assert lines in write_description(found)
    with pytest.raises(SdpError, match="more than 64 data channels"):
        parse_description(text.replace(lines, lines * 33))
