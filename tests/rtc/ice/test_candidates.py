import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.ice.candidates import Candidate, CandidateError, candidate_priority, pair_priority, parse_candidate
from lockstep.rtc.ice.check_list import may_pair
from lockstep.rtc.ice.gathering import Advertised, AdvertisedError, gather, parse_advertised

HOST = "candidate:1 1 udp 2130706431 192.0.2.1 5000 typ host"


@pytest.mark.parametrize(
    "line",
    [
        HOST,
        "candidate:2 1 udp 1694498815 203.0.113.7 61000 typ srflx raddr 192.0.2.1 rport 5000",
        "candidate:3 1 tcp 1518280447 192.0.2.1 9 typ host tcptype active ufrag abcd",
        "candidate:Mgy3 1 udp 2113937151 2001:db8::1 5000 typ relay raddr 2001:db8::2 rport 9",
        "candidate:4 1 udp 2113939711 0b1e7a1c-5f5c-4f2a-9d0e-000000000000.local 51000 typ host ufrag abcd",
    ],
)
def test_a_line_is_written_as_it_was_read(line: str) -> None:
    assert parse_candidate(line).line() == line
    assert parse_candidate(f"a={line}").line() == line


def test_the_words_of_chromium_are_understood_or_skipped() -> None:
    line = f"{HOST} generation 0 ufrag Ab+/ network-id 1 network-cost 10"
    assert parse_candidate(line).line() == f"{HOST} ufrag Ab+/"


def test_an_ipv6_address_has_one_way_of_writing() -> None:
    assert parse_candidate(HOST.replace("192.0.2.1", "2001:DB8:0:0::1")).host == "2001:db8::1"


@pytest.mark.parametrize(
    "line",
    [
        "",
        "candidate:1 1 udp 2130706431 192.0.2.1 5000",
        HOST.replace("udp", "ssltcp"),
        HOST.replace("udp", "tcp"),  # without its type
        HOST.replace("host", "carrier"),
        HOST.replace("5000", "65536"),
        HOST.replace("2130706431", "0"),
        HOST.replace("2130706431", "2147483648"),
        HOST.replace("candidate:1 1", "candidate:1 0"),
        HOST.replace("candidate:1 1", "candidate:1 257"),
        HOST.replace("candidate:1", "candidate:" + "1" * 33),
        HOST + " raddr",
        HOST + " a b" * 17,
        HOST + "\r\na=x",
        HOST.replace("5000", "٥٠٠٠"),
        HOST + " " + "x" * 2000,
    ],
)
def test_what_is_no_candidate_is_refused_by_name(line: str) -> None:
    with pytest.raises(CandidateError):
        parse_candidate(line)


@given(st.text(max_size=100), st.integers(0, len(HOST)))
def test_any_text_is_a_candidate_or_the_one_error(text: str, place: int) -> None:
    for line in (text, HOST[:place] + text + HOST[place:]):
        try:
            found = parse_candidate(line)
        except CandidateError:
            continue
        assert parse_candidate(found.line()) == found


@pytest.mark.parametrize(
    ("host", "port", "is_address", "can_be_sent_to"),
    [
        ("192.0.2.1", 5000, True, True),
        ("2001:db8::1", 5000, True, True),
        ("host.local", 5000, False, False),
        ("fe80::1%eth0", 5000, False, True),
        ("192.0.2.1", 0, True, False),
        ("0.0.0.0", 5000, True, False),
        ("::", 5000, True, False),
        ("224.0.0.251", 5353, True, False),
        ("255.255.255.255", 5000, True, False),
    ],
)
def test_names_and_addresses_of_no_single_host_are_told(
    host: str, port: int, is_address: bool, can_be_sent_to: bool
) -> None:
    candidate = Candidate("1", 1, "udp", 1, host, port, "host")
    assert (candidate.is_ip_address, candidate.can_be_sent_to) == (is_address, can_be_sent_to)


def test_udp_comes_before_tcp_and_what_is_direct_before_what_is_relayed() -> None:
    order = [
        candidate_priority("host", 65535),
        candidate_priority("prflx", 65535),
        candidate_priority("srflx", 65535),
        candidate_priority("host", 8191, "active"),
        candidate_priority("host", 8191, "passive"),
        candidate_priority("host", 0, "passive"),
        candidate_priority("srflx", 8191, "passive"),
        candidate_priority("relay", 65535),
    ]
    assert order == sorted(order, reverse=True)
    assert all(0 < priority < 1 << 31 for priority in order)


def test_both_agents_give_a_pair_the_same_priority() -> None:
    assert pair_priority(3, 2) == (2 << 32) + 6 + 1
    assert pair_priority(2, 3) == (2 << 32) + 6


def test_every_host_has_candidates_and_the_first_is_preferred() -> None:
    found = [local.candidate for local in gather(["192.0.2.1", "2001:db8::1"], 5000, tcp_port=443)]
    assert [(each.transport, each.host, each.port, each.tcp_type) for each in found] == [
        ("udp", "192.0.2.1", 5000, None),
        ("tcp", "192.0.2.1", 443, "passive"),
        ("udp", "2001:db8::1", 5000, None),
        ("tcp", "2001:db8::1", 443, "passive"),
    ]
    assert found[0].priority > found[2].priority > found[1].priority > found[3].priority
    assert len({each.foundation for each in found}) == 4
    assert all(parse_candidate(each.line()) == each for each in found)


def test_an_advertised_address_stands_for_the_inner_one() -> None:
    found = gather(["10.0.0.5", "10.0.0.6"], 5000, advertised=[parse_advertised("203.0.113.7=10.0.0.6")])
    assert found[-1].base == ("10.0.0.6", 5000)
    assert found[-1].candidate.line().endswith("203.0.113.7 5000 typ srflx raddr 10.0.0.6 rport 5000")


def test_an_advertised_address_alone_stands_for_the_first_of_its_version() -> None:
    found = gather(["2001:db8::5", "10.0.0.5"], 5000, advertised=[Advertised("203.0.113.7")])
    assert found[-1].base == ("10.0.0.5", 5000)


def test_an_advertised_address_of_nothing_that_is_bound_is_left_out() -> None:
    assert (
        len(gather(["10.0.0.5"], 5000, advertised=[Advertised("2001:db8::7"), Advertised("203.0.113.7", "10.9.9.9")]))
        == 1
    )


@pytest.mark.parametrize(
    "text", ["", "example.org", "203.0.113.7=", "203.0.113.7=2001:db8::1", "1.2.3.4=1.2.3.4=1.2.3.4"]
)
def test_what_is_no_advertised_address_is_refused_by_name(text: str) -> None:
    with pytest.raises(AdvertisedError):
        parse_advertised(text)


@pytest.mark.parametrize(
    ("remote", "expected"),
    [
        ("candidate:1 1 udp 1 198.51.100.7 5000 typ host", True),
        ("candidate:1 2 udp 1 198.51.100.7 5000 typ host", False),
        ("candidate:1 1 udp 1 2001:db8::7 5000 typ host", False),
        ("candidate:1 1 tcp 1 198.51.100.7 9 typ host tcptype active", False),
    ],
)
def test_candidates_pair_with_their_kind(remote: str, expected: bool) -> None:
    udp, tcp = gather(["192.0.2.1"], 5000, tcp_port=5000)
    assert may_pair(udp, parse_candidate(remote)) is expected
    assert not may_pair(tcp, parse_candidate(remote))


def test_link_local_addresses_pair_with_each_other_alone() -> None:
    near, far = gather(["fe80::1", "2001:db8::1"], 5000)
    remote = parse_candidate("candidate:1 1 udp 1 fe80::2 5000 typ host")
    assert may_pair(near, remote)
    assert not may_pair(far, remote)
