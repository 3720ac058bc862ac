import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.errors import BadSdp, BadSdpFragment, TooManySections
from server.offer import MAX_CANDIDATES, MAX_SECTIONS, format_fragment, parse_fragment, prepare_offer
from tests.server.offers import FINGERPRINT, offer, section

GOOD = offer(section("0"), section("1", "audio"), section("2", "application"))
URI = "urn:x-lockstep:rtp-hdrext:event-reference"
HOST = "a=candidate:1 1 udp 2130706431 192.0.2.7 5000 typ host\r\n"
LOCAL = "a=candidate:1 1 udp 2130706431 0a1b2c3d.local 5000 typ host\r\n"


def test_a_good_offer_is_kept_as_it_is() -> None:
    good = offer(section("0", candidate=HOST))
    assert prepare_offer(good) == good


def test_a_data_channel_section_gets_the_default_message_size() -> None:
    assert prepare_offer(GOOD).count("a=max-message-size:65536") == 1
    told = offer(section("0", "application", "a=max-message-size:262144\r\n"))
    assert prepare_offer(told) == told


def test_mdns_candidates_are_taken_out_and_ice_waits_for_the_browsers_checks() -> None:
    prepared = prepare_offer(offer(section("0", candidate=LOCAL, extra="a=end-of-candidates\r\n")))
    assert ".local" not in prepared
    assert "end-of-candidates" not in prepared


def test_without_mdns_candidates_the_end_stays_the_end() -> None:
    assert "a=end-of-candidates" in prepare_offer(offer(section("0", candidate=HOST + "a=end-of-candidates\r\n")))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        "v=0\r\n",
        offer(),
        offer(*[section(str(number)) for number in range(MAX_SECTIONS + 1)]),
        offer(section("0", "application"), section("1", "application")),
        offer(section("0"), section("0", "audio")),
        offer(section("0"), section("1"), bundle="0"),
        offer(section("0"), bundle=""),
        offer(section("0"), bundle="0 1"),
        offer(section("0").replace("a=mid:0\r\n", "")),
        offer(section("0").replace("a=ice-ufrag:abcd\r\n", "")),
        offer(section("0").replace("a=ice-pwd:0123456789abcdef0123456789\r\n", "")),
        offer(section("0").replace(f"a=fingerprint:{FINGERPRINT}\r\n", "")),
        offer(section("0").replace("a=setup:actpass\r\n", "")),
        offer(section("0").replace("m=video", "m=smell")),
        offer(section("0", "application").replace("a=sctp-port:5000\r\n", "")),
        offer(section("0", candidate=HOST * (MAX_CANDIDATES + 1))),
        offer(section("0").replace("96 VP8/90000", "VP8")),
        offer(section("0").replace("SAVPF 96", "SAVPF 128")),
        offer(section("0").replace("SAVPF 96", "SAVPF 96 9999999999999")),
        offer(section("0", extra="a=extmap:x urn:x\r\n")),
        offer(section("0", extra="a=extmap:1\r\n")),
    ],
)
def test_an_offer_that_cannot_be_answered_is_refused(text: str) -> None:
    with pytest.raises(BadSdp):
        prepare_offer(text)


@given(st.text())
def test_no_text_raises_anything_else(text: str) -> None:
    with pytest.raises(BadSdp):
        prepare_offer(text)


@given(st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 30), st.text(max_size=8)), min_size=1, max_size=4))
def test_no_mutation_raises_anything_else(cuts: list[tuple[int, int, str]]) -> None:
    text = GOOD
    for place, length, instead in cuts:
        text = text[:place] + instead + text[place + length :]
    with contextlib.suppress(BadSdp):
        prepare_offer(text)


@given(st.permutations(GOOD.splitlines()))
def test_no_order_of_lines_raises_anything_else(lines: list[str]) -> None:
    with contextlib.suppress(BadSdp):
        prepare_offer("\r\n".join(lines))


PASSWORD = "0123456789abcdef0123456789"


def test_a_fragment_gives_its_candidates_with_their_section() -> None:
    text = f"a=ice-ufrag:abcd\r\n{HOST}m=audio 9 RTP/AVP 0\r\na=mid:1\r\n{HOST}{LOCAL}a=end-of-candidates\r\n"
    found = parse_fragment(text, "0")
    assert (found.username, found.password) == ("abcd", "")
    assert [(each.mid, each.line[:10]) for each in found.candidates] == [("0", "candidate:"), ("1", "candidate:")]


def test_our_own_fragment_can_be_read_back() -> None:
    text = format_fragment("abcd", PASSWORD, "video", "1", [HOST.strip().removeprefix("a=")])
    assert parse_fragment(text, "") == ("abcd", PASSWORD, [("1", HOST.strip().removeprefix("a="))])
    assert text.endswith("a=end-of-candidates\r\n")


@pytest.mark.parametrize(
    "text",
    [
        "hello",
        HOST * (MAX_CANDIDATES + 1),
        "a=ice-ufrag:abc",
        "a=ice-ufrag:" + "x" * 257,
        "a=ice-ufrag:ab cd",
        "a=ice-ufrag:abcd\r\na=ice-ufrag:efgh",
        "a=ice-pwd:short",
        "a=ice-pwd:",
    ],
)
def test_what_is_no_fragment_is_refused(text: str) -> None:
    with pytest.raises(BadSdpFragment):
        parse_fragment(text, "0")


@given(st.text())
def test_no_fragment_raises_anything_else(text: str) -> None:
    with contextlib.suppress(BadSdpFragment):
        parse_fragment(text, "0")


def _ids(text: str) -> list[str]:
    return [line[9:] for line in prepare_offer(text).splitlines() if line.startswith("a=extmap:")]


def _with_ids(*mappings: str) -> str:
    return offer(section("0", candidate="".join(f"a=extmap:{each}\r\n" for each in mappings)))


@pytest.mark.parametrize("number", [1, 14, 15, 16, 255])
def test_an_id_that_fits_a_packet_stays(number: int) -> None:
    assert _ids(_with_ids(f"{number} {URI}")) == [f"{number} {URI}"]


@pytest.mark.parametrize("number", [0, 256, 4095, 4352, 999999999])
def test_an_extension_with_an_id_that_no_answer_can_have_is_left_out(number: int) -> None:
    assert _ids(_with_ids(f"{number} {URI}", "3 urn:other")) == ["3 urn:other"]


@pytest.mark.parametrize("number", [4096, 4351])
def test_an_id_that_is_left_to_the_answer_becomes_one_that_the_offer_has_nowhere(number: int) -> None:
    assert _ids(_with_ids("1 urn:a", f"{number}/sendonly {URI} more", "2 urn:b")) == [
        "1 urn:a",
        f"3/sendonly {URI}",
        "2 urn:b",
    ]


def test_an_extension_has_the_same_chosen_id_in_every_section() -> None:
    sections = [
        section(mid, candidate=f"a=extmap:{4096 + int(mid)} {URI}\r\na=extmap:4200 urn:{mid}\r\n") for mid in "01"
    ]
    assert _ids(offer(*sections)) == [f"1 {URI}", "2 urn:0", f"1 {URI}", "3 urn:1"]


def test_fifteen_is_never_chosen_and_what_finds_no_free_id_is_left_out() -> None:
    taken = [f"{number} urn:{number}" for number in range(1, 256) if number not in (15, 200)]
    assert _ids(_with_ids(*taken, "4096 urn:first", "4097 urn:second"))[-1] == "200 urn:first"


def test_more_sections_than_a_robot_needs_are_refused_by_name_and_a_robot_with_many_streams_gets_them() -> None:
    text = offer(*[section(str(number)) for number in range(MAX_SECTIONS + 1)])
    with pytest.raises(TooManySections, match=f"more than {MAX_SECTIONS} media sections"):
        prepare_offer(text)
    assert prepare_offer(text, MAX_SECTIONS + 1)


def test_a_payload_type_beyond_seven_bits_is_refused_in_words() -> None:
    with pytest.raises(BadSdp, match="payload type 128: 0 to 127"):
        prepare_offer(offer(section("0").replace("SAVPF 96", "SAVPF 96 128")))
