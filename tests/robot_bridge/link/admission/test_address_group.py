import pytest

from lockstep.robot_bridge.link.admission.address_group import address_group


@pytest.mark.parametrize(
    ("address", "group"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", None),
    ],
)
def test_an_ipv6_address_counts_with_the_64_bits_that_one_customer_has(address: str, group: str | None) -> None:
    assert address_group(address) == group
