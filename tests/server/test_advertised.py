"""Candidates at outer addresses: behind each inner one, of its family, and of no other kind."""

from server.advertised import advertised_candidates, with_advertised

HOST = "candidate:0a1b 1 udp 2130706431 10.0.0.5 50000 typ host"


def test_a_host_candidate_is_offered_again_at_each_outer_address_of_its_family() -> None:
    made = [each.split() for each in advertised_candidates(HOST, ["203.0.113.1", "2001:db8::1", "203.0.113.2"])]
    assert [(each[4], each[5], each[7]) for each in made] == [
        ("203.0.113.1", "50000", "host"),
        ("203.0.113.2", "50000", "host"),
    ]
    assert len({each[0] for each in made} | {"candidate:0a1b"}) == 3, "a foundation of their own (RFC 8445 5.1.1.3)"
    priorities = [int(each[3]) for each in made]
    assert 2130706431 > priorities[0] > priorities[1] > 2**24 * 110, "behind the inner one, before all other kinds"
    assert all(len(each[0].removeprefix("candidate:")) <= 32 for each in made)


def test_an_inner_address_of_ipv6_is_offered_at_the_outer_of_ipv6() -> None:
    inner = "candidate:1 1 udp 2130706431 fd00::5 50000 typ host"
    assert [each.split()[4] for each in advertised_candidates(inner, ["203.0.113.1", "2001:db8::1"])] == ["2001:db8::1"]


def test_what_no_nat_leads_to_is_not_offered() -> None:
    for other in (
        "candidate:1 1 udp 1694498815 198.51.100.9 50000 typ srflx raddr 10.0.0.5 rport 50000",
        "candidate:1 1 udp 16777215 198.51.100.9 50000 typ relay raddr 10.0.0.5 rport 50000",
        "candidate:1 1 udp 2130706431 127.0.0.1 50000 typ host",
        "candidate:1 1 udp 2130706431 ::1 50000 typ host",
        "candidate:1",
    ):
        assert advertised_candidates(other, ["203.0.113.1", "2001:db8::1"]) == []


def test_a_description_has_them_behind_the_inner_ones_and_is_untouched_without_outer_addresses() -> None:
    sdp = f"v=0\r\na={HOST}\r\na=end-of-candidates\r\n"
    assert with_advertised(sdp, []) == sdp
    lines = with_advertised(sdp, ["203.0.113.1"]).splitlines()
    assert [line.split(":")[0] for line in lines] == ["v=0", "a=candidate", "a=candidate", "a=end-of-candidates"]
    assert " 203.0.113.1 50000 typ host" in lines[2]
