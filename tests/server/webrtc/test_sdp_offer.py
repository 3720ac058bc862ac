import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.errors import BadSdp, BadSdpFragment, TooManySections
from lockstep.server.webrtc.sdp_offer import MAX_CANDIDATES, MAX_SECTIONS, parse_fragment, parse_offer
from tests.server.offers import FINGERPRINT, offer, section

GOOD = offer(section("0"), section("1", "audio"), section("2", "application"))
HOST = "a=candidate:1 1 udp 2130706431 192.0.2.7 5000 typ host\r\n"
LOCAL = "a=candidate:1 1 udp 2130706431 0a1b2c3d.local 5000 typ host\r\n"


def test_a_good_offer_says_what_it_said() -> None:
    found = parse_offer(offer(section("0", candidate=HOST), section("1", "application")))
    assert [(each.mid, each.kind) for each in found.sections] == [("0", "video"), ("1", "application")]
    assert found.transport.candidates == (HOST.strip().removeprefix("a="),)


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
        offer(section("0", "application").replace("a=sctp-port:5000\r\n", "")),
        offer(section("0", candidate=HOST * (MAX_CANDIDATES + 1))),
        offer(section("0").replace("SAVPF 96", "SAVPF 128")),
        offer(section("0").replace("SAVPF 96", "SAVPF 96 9999999999999")),
        offer(section("0", extra="a=extmap:x urn:x\r\n")),
        offer(section("0", extra="a=extmap:1\r\n")),
    ],
)
def test_an_offer_that_cannot_be_answered_is_refused(text: str) -> None:
    with pytest.raises(BadSdp):
        parse_offer(text)


@given(st.text())
def test_no_text_raises_anything_else(text: str) -> None:
    with pytest.raises(BadSdp):
        parse_offer(text)


@given(st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 30), st.text(max_size=8)), min_size=1, max_size=4))
def test_no_mutation_raises_anything_else(cuts: list[tuple[int, int, str]]) -> None:
    text = GOOD
    for place, length, instead in cuts:
        text = text[:place] + instead + text[place + length :]
    with contextlib.suppress(BadSdp):
        parse_offer(text)


@given(st.permutations(GOOD.splitlines()))
def test_no_order_of_lines_raises_anything_else(lines: list[str]) -> None:
    with contextlib.suppress(BadSdp):
        parse_offer("\r\n".join(lines))


def test_a_fragment_gives_its_candidates_with_their_section() -> None:
    text = f"a=ice-ufrag:abcd\r\n{HOST}m=audio 9 RTP/AVP 0\r\na=mid:1\r\n{HOST}{LOCAL}a=end-of-candidates\r\n"
    found = parse_fragment(text, "0")
    assert (found.ufrag, found.password) == ("abcd", "")
    assert [(each.mid, each.line[:10]) for each in found.candidates] == [("0", "candidate:"), ("1", "candidate:")]


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


def test_more_sections_than_a_robot_needs_are_refused_by_name_and_a_robot_with_many_streams_gets_them() -> None:
    text = offer(*[section(str(number)) for number in range(MAX_SECTIONS + 1)])
    with pytest.raises(TooManySections, match=f"more than {MAX_SECTIONS} media sections"):
        parse_offer(text)
    assert parse_offer(text, MAX_SECTIONS + 1)


def test_a_payload_type_beyond_seven_bits_is_refused_in_words() -> None:
    with pytest.raises(BadSdp, match="payload type 128: 0 to 127"):
        parse_offer(offer(section("0").replace("SAVPF 96", "SAVPF 96 128")))
