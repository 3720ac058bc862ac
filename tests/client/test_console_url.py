import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.console_url import parse_link
from lockstep.client.errors import LinkFormatError


def test_a_printed_link_has_a_base_and_a_token() -> None:
    link = parse_link("http://127.0.0.1:8000/#token=abc.def-_")
    assert (link.base, link.token, link.loopback, link.secure) == ("http://127.0.0.1:8000", "abc.def-_", True, False)


@pytest.mark.parametrize(
    ("host", "loopback"), [("localhost", True), ("[::1]", True), ("10.0.0.1", False), ("robot.example", False)]
)
def test_loopback_is_told_from_the_host(host: str, loopback: bool) -> None:
    link = parse_link(f"https://{host}/#token=t")
    assert (link.loopback, link.secure) == (loopback, True)


@pytest.mark.parametrize(
    "link",
    ["", "127.0.0.1:8000", "ftp://a/#token=t", "http:///#token=t", "http://a", "http://a/#t", "http://a:x/#token=t"],
)
def test_anything_else_is_refused(link: str) -> None:
    with pytest.raises(LinkFormatError):
        parse_link(link)


@given(st.text())
def test_no_text_does_more_than_be_refused(text: str) -> None:
    for link in (text, f"http://{text}/#token=t", f"http://host/{text}"):
        with contextlib.suppress(LinkFormatError):
            parse_link(link)
