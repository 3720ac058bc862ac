import pytest

from lockstep.server.http.transport.client_address import NO_ADDRESS, counted_address


@pytest.mark.parametrize(
    ("text", "counted"),
    [
        ("192.0.2.1", "192.0.2.1"),
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::9", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("192.0.2.1:80", NO_ADDRESS),
        ("", NO_ADDRESS),
        ("x" * 16_000, NO_ADDRESS),
    ],
)
def test_a_client_is_counted_by_its_address_and_an_ipv6_one_by_its_network(text: str, counted: str) -> None:
    assert counted_address(text) == counted
