"""What a service manager hears, on real sockets."""

import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from lockstep.robot_bridge.service_manager import ServiceManager


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[socket.socket, str]]:
    """Where a service manager listens, and what it writes into NOTIFY_SOCKET."""
    name = str(tmp_path / "notify") if request.param == "path" else f"@lockstep-{secrets.token_hex(8)}"
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listening:
        listening.bind(f"\0{name[1:]}" if name.startswith("@") else name)
        listening.settimeout(20.0)
        yield listening, name


def test_it_hears_that_the_bridge_is_ready_alive_and_stopping(manager: tuple[socket.socket, str]) -> None:
    listening, name = manager
    service = ServiceManager({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "12000000", "WATCHDOG_PID": str(os.getpid())})
    assert service.watchdog_seconds == 12.0
    service.ready()
    service.alive()
    service.stopping()
    service.close()
    service.close()
    assert [listening.recv(100) for _ in range(3)] == [b"READY=1", b"WATCHDOG=1", b"STOPPING=1"]


@pytest.mark.parametrize(
    "watchdog",
    [
        {},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "12000000", "WATCHDOG_PID": "1"},
    ],
    ids=["none", "zero", "no-number", "of-another-process"],
)
def test_signs_of_life_are_sent_only_where_somebody_looks(
    manager: tuple[socket.socket, str], watchdog: dict[str, str]
) -> None:
    listening, name = manager
    service = ServiceManager({"NOTIFY_SOCKET": name, **watchdog})
    assert service.watchdog_seconds is None
    service.alive()
    service.ready()
    service.close()
    assert listening.recv(100) == b"READY=1"


@pytest.mark.parametrize("name", ["", "no/absolute/path", "vsock:2:1234", "/nowhere/at/all", "@" + "x" * 200])
def test_a_bridge_without_a_manager_goes_on(name: str, caplog: pytest.LogCaptureFixture) -> None:
    service = ServiceManager({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "1000000"})
    for _ in range(3):
        service.ready()
        service.alive()
    service.close()
    assert len(caplog.records) == (1 if name.startswith(("/", "@")) else 0), "it is said once"


def test_a_manager_that_does_not_read_holds_nobody_up(tmp_path: Path) -> None:
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listening:
        listening.bind(str(tmp_path / "notify"))
        service = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"})
        for _ in range(10_000):
            service.alive()
        service.close()
