"""The address by which a machine reaches its own console."""

import socket
from pathlib import Path
from typing import Any, cast

import pytest

from lockstep.server.cli.console_address import local_url
from lockstep.server.http.transport.serve import bind
from tests.server.cli.test_console_request import RECORDING, answering, lockstep

INTERFACES = Path("/proc/net/if_inet6")
LINK_SCOPE = "20"  # of an address in that file, as the kernel writes it


class Listener:
    def __init__(self, *name: Any) -> None:
        self._name = name

    def getsockname(self) -> tuple[Any, ...]:
        return self._name


def link_local() -> str:
    """An address of this machine with its interface, "fe80::1%eth0"; "" if it has none."""
    for line in INTERFACES.read_text().splitlines() if INTERFACES.exists() else ():
        digits, _, _, scope, _, interface = line.split()
        if scope == LINK_SCOPE:
            return f"{socket.inet_ntop(socket.AF_INET6, bytes.fromhex(digits))}%{interface}"
    return ""


@pytest.mark.parametrize(
    ("name", "url"),
    [
        (("192.0.2.7", 80), "http://192.0.2.7:80"),
        (("0.0.0.0", 80), "http://127.0.0.1:80"),
        (("::", 80, 0, 0), "http://[::1]:80"),
        (("2001:db8::1", 80, 0, 0), "http://[2001:db8::1]:80"),
        (("fe80::1", 80, 0, socket.if_nametoindex("lo")), "http://[fe80::1%lo]:80"),
        (("fe80::1%lo", 80, 0, socket.if_nametoindex("lo")), "http://[fe80::1%lo]:80"),
        (("fe80::1", 80, 0, 2_000_000_000), "http://[fe80::1%2000000000]:80"),
    ],
)
def test_the_url_of_a_listener_names_the_interface_of_a_link_local_address(name: tuple[Any, ...], url: str) -> None:
    assert local_url(cast(socket.socket, Listener(*name)), encrypted=False) == url


def test_a_listener_at_a_link_local_address_is_reached_by_its_url() -> None:
    if not (host := link_local()):
        pytest.skip("this machine has no link-local address")
    with bind(host, 0) as listener:
        url = local_url(listener, encrypted=False)
        assert url == f"http://[{host}]:{listener.getsockname()[1]}"
        with socket.create_connection((host, listener.getsockname()[1]), timeout=5.0):
            pass


def test_a_command_asks_a_console_at_a_link_local_address(tmp_path: Path) -> None:
    if not (host := link_local()):
        pytest.skip("this machine has no link-local address")
    with answering(RECORDING, host=host) as local:
        done = lockstep(tmp_path, local, "record", "status")
    assert done.exit_code == 0, done.output
