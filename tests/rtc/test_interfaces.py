import ipaddress

import pytest

from lockstep.rtc.interfaces import own_addresses


class Ip:
    def __init__(self, ip: str | tuple[str, int, int]) -> None:
        self.ip = ip


class Adapter:
    def __init__(self, *ips: str | tuple[str, int, int]) -> None:
        self.ips = [Ip(ip) for ip in ips]


def test_loopback_and_link_local_addresses_are_left_out_and_ipv4_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    adapters = [
        Adapter("127.0.0.1", ("::1", 0, 0)),
        Adapter(("2001:db8::5", 0, 0), ("fe80::1", 0, 2), "169.254.1.1", "192.0.2.1"),
        Adapter("192.0.2.1"),
    ]
    monkeypatch.setattr("ifaddr.get_adapters", lambda: adapters)
    assert own_addresses() == ["192.0.2.1", "2001:db8::5"]


def test_a_machine_of_many_addresses_names_sixteen(monkeypatch: pytest.MonkeyPatch) -> None:
    many = Adapter(*(f"192.0.2.{number}" for number in range(1, 40)))
    monkeypatch.setattr("ifaddr.get_adapters", lambda: [many])
    assert len(own_addresses()) == 16


def test_those_of_this_machine_are_addresses() -> None:
    assert all(ipaddress.ip_address(each) for each in own_addresses())
