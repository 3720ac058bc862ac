import socket

import pytest

from server.access import Access
from server.links import console_links
from server.serve import PortTaken, bind
from server.settings import Settings

ACCESS = Access("a secret of at least thirty-two bytes", 60, 60)


@pytest.mark.parametrize(("host", "shown"), [("127.0.0.1", "http://127.0.0.1:"), ("::1", "http://[::1]:")])
def test_links_name_the_address_that_is_really_listened_on(host: str, shown: str) -> None:
    with bind(host, 0) as listener:
        links = console_links(Settings(host=host), listener, ACCESS)
        assert links.console == f"{shown}{listener.getsockname()[1]}"
        assert links.operator.startswith(f"{links.console}/#token=")
        assert ACCESS.verify(links.operator.partition("=")[2]).role == "operator"
        assert ACCESS.verify(links.observer.partition("=")[2]).role == "observer"
        assert links.robot == "tcp://127.0.0.1:5600"


def test_a_console_on_all_interfaces_names_one_that_others_can_reach() -> None:
    with bind("0.0.0.0", 0) as listener:
        assert "0.0.0.0" not in console_links(Settings(host="0.0.0.0"), listener, ACCESS).console


def test_people_get_both_links_and_are_told_what_they_are_for() -> None:
    with bind("127.0.0.1", 0) as listener:
        links = console_links(Settings(), listener, ACCESS)
    text = links.for_people()
    assert f"To drive, open:   {links.operator}" in text
    assert f"To watch, open:   {links.observer}" in text


def test_a_port_or_address_that_cannot_be_had_is_named() -> None:
    with bind("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(PortTaken, match=rf"127\.0\.0\.1:{port}"):
            bind("127.0.0.1", port)
    with pytest.raises(PortTaken):
        bind("192.0.2.1", 0)
    with pytest.raises(PortTaken):
        bind("no such host", 0)


def test_a_bound_socket_is_a_listening_one() -> None:
    with bind("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname(), timeout=5):
        pass
