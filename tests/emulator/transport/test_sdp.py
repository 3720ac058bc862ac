import pytest

from lockstep.emulator.errors import BadDescription
from lockstep.emulator.transport.sdp import (
    Address,
    candidates_replaced,
    console_addresses,
    ice_names,
    reached_from,
    without_candidates,
)

ANSWER = "\r\n".join(
    [
        "v=0",
        "a=ice-ufrag:abcd",
        "m=audio 9 UDP/TLS/RTP/SAVPF 0",
        "a=mid:0",
        "a=candidate:1 1 udp 2130706431 fe80::1 4000 typ host",
        "a=candidate:2 1 udp 2130706431 192.0.2.7 4001 typ host",
        "a=candidate:3 1 UDP 2130706431 127.0.0.1 4002 typ host",
        "a=end-of-candidates",
        "m=video 9 UDP/TLS/RTP/SAVPF 96",
        "a=ice-ufrag:efgh",
        "a=candidate:2 1 udp 2130706431 192.0.2.7 4001 typ host",
        "",
    ]
)


def test_names_and_addresses_are_found() -> None:
    assert ice_names(ANSWER) == {"abcd", "efgh"}
    assert console_addresses(ANSWER)[:2] == [Address("192.0.2.7", 4001), Address("127.0.0.1", 4002)]


def test_a_client_is_led_to_the_console_at_the_address_at_which_it_finds_the_forwarder() -> None:
    console = console_addresses(ANSWER)
    assert reached_from("127.0.0.1", console) == Address("127.0.0.1", 4002)
    assert reached_from("203.0.113.5", console) == Address("192.0.2.7", 4001)


def test_an_answer_without_an_address_is_refused_with_what_to_do() -> None:
    with pytest.raises(BadDescription, match="--ice-host"):
        console_addresses(without_candidates(ANSWER))


def test_nothing_of_a_way_around_is_left_in_an_offer() -> None:
    left = without_candidates(ANSWER)
    assert "candidate" not in left
    assert left.count("m=") == 2
    assert left.endswith("\r\n")


def test_the_forwarders_addresses_take_the_place_of_each_sections_own() -> None:
    addresses = [Address("127.0.0.1", 5001), Address("192.0.2.7", 5002)]
    audio, video = candidates_replaced(ANSWER, addresses).split("m=")[1:]
    for section in (audio, video):
        found = [line.split() for line in section.splitlines() if line.startswith("a=candidate:")]
        assert [(line[4], line[5]) for line in found] == [("127.0.0.1", "5001"), ("192.0.2.7", "5002")]
        assert int(found[0][3]) > int(found[1][3]), "earlier ones are preferred"
    assert "4001" not in audio + video
