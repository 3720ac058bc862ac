from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.sdp import Fragment, FragmentCandidate, SdpError, parse_fragment, write_fragment

PASSWORD = "0123456789abcdef0123456789"
LINE = "candidate:1 1 udp 2130706431 192.0.2.7 5000 typ host"
TEXT = (
    f"a=ice-ufrag:abcd\r\na=ice-pwd:{PASSWORD}\r\nm=audio 9 RTP/AVP 0\r\na=mid:7\r\na={LINE}\r\na=end-of-candidates\r\n"
)
FRAGMENT = Fragment("abcd", PASSWORD, (FragmentCandidate("7", LINE),), True)


def test_a_fragment_is_read_and_written() -> None:
    assert parse_fragment(TEXT, "0") == FRAGMENT
    assert parse_fragment(write_fragment(FRAGMENT, "video", "7"), "0") == FRAGMENT
    assert parse_fragment(write_fragment(Fragment(), "video", "7"), "0") == Fragment()


def test_candidates_before_the_first_section_are_for_the_first_one() -> None:
    assert parse_fragment(f"a={LINE}\n", "0").candidates == (FragmentCandidate("0", LINE),)


@pytest.mark.parametrize(
    "text",
    [
        "hello",
        "a=ice-ufrag:abc\r\n",
        "a=ice-pwd:short\r\n",
        "a=ice-ufrag:abcd\r\na=ice-ufrag:abce\r\n",
        f"a={LINE}\r\n" * 101,
        "a=mid:\r\n",
        "\r\n" * 40_000,
    ],
)
def test_what_is_no_fragment_is_refused(text: str) -> None:
    with pytest.raises(SdpError):
        parse_fragment(text, "0")


def test_the_password_is_in_no_text() -> None:
    assert PASSWORD not in repr(FRAGMENT)


@given(st.text())
def test_no_text_raises_anything_else(text: str) -> None:
    with suppress(SdpError):
        parse_fragment(text, "0")
