"""Connections of people who know no secret, many and fast, while a console far away opens its link."""

import asyncio
import contextlib
import ssl
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import pytest

from lockstep.bench.harness.tcp_path import TcpPath
from lockstep.protocol.errors import LinkLost, LinkRefused
from lockstep.protocol.framing import frame
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import Hello, encode_message
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import RecordingRobot
from tests.robot_bridge.link.flood.flooding import flooding
from tests.support.certificates import Authority

SECRET = LinkSecret.draw()
DELAY = 0.05  # s each way between console and bridge
FLOOD = 640  # connections a second
OPEN = 400  # connections that the flood keeps open; the bridge closes most of them


FLOODING = """
import contextlib, os, socket, sys, time

os.nice(10)  # it stands for another machine, which takes no processor time of the bridge's

host, says = sys.argv[1], bytes.fromhex(sys.argv[5])
port, rate, kept = int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
sockets, made, began = [], 0, time.monotonic()
print("floods", flush=True)
while True:
    due = (time.monotonic() - began) * rate
    made = max(made, due - rate / 20)  # what a busy machine held up for longer is not made good at once
    while made < due:
        made += 1
        connection = socket.socket()
        connection.setblocking(False)
        connection.bind((host, 0))
        connection.connect_ex(("127.0.0.1", port))
        sockets.append(connection)
        if len(sockets) > kept:
            sockets.pop(0).close()
    time.sleep(0.005)
    for connection in sockets[-20:]:
        with contextlib.suppress(OSError):
            connection.send(says)
"""


def flood(address: tuple[str, int], host: str, says: bytes) -> AbstractAsyncContextManager[None]:
    """Connections from `host`, each of which says this and nothing else."""
    return flooding(FLOODING, host, str(address[1]), str(FLOOD), str(OPEN), says.hex())


async def _opens(path: TcpPath, trust: ssl.SSLContext | None) -> bool:
    """At the first try, or on a machine that is slower than the flood at the third: a console tries again at once."""
    for _ in range(3):
        with contextlib.suppress(LinkLost, LinkRefused):
            async with RobotLink("127.0.0.1", path.port, "operator", secret=SECRET, tls=trust) as link:
                return link.connected
    return False


@pytest.mark.parametrize("tls", [False, True], ids=["plain", "tls"])
@pytest.mark.parametrize("host", ["127.0.0.2", "127.0.0.1"], ids=["from-elsewhere", "from-the-console's-address"])
@pytest.mark.parametrize("says", [b"", b"hello"], ids=["silent", "hello"])
async def test_a_console_gets_its_link_every_time(tls: bool, host: str, says: bytes, tmp_path: Path) -> None:
    bridge_tls = trust = None
    if tls:
        authority = Authority(tmp_path)
        bridge_tls = LinkTls(certificate=authority.issue("bridge"))
        trust = LinkTls(authority=authority.certificate).client_context()
    if says:
        says = (
            frame(encode_message(Hello(role="operator", nonce=bytes(32)))) if not tls else b"\x16\x03\x01\x02\x00\x01"
        )
    settings = BridgeSettings(port=0, secret=SECRET, tls=bridge_tls)
    async with (
        Bridge(RecordingRobot(), settings) as bridge,
        TcpPath((bridge.address[0], bridge.address[1]), delay=DELAY) as path,
        flood(bridge.address, host, says),
    ):
        async with asyncio.timeout(40):
            while not sum(bridge.counters.endings.values()) + bridge.counters.bad_input["tls"]:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        for _ in range(10):
            assert await _opens(path, trust)


async def test_a_console_that_was_admitted_comes_back_while_strangers_take_all_handshakes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_RATE", 0.001)
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_BURST", 1)
    authority = Authority(tmp_path)
    trust = LinkTls(authority=authority.certificate).client_context()
    settings = BridgeSettings(port=0, secret=SECRET, tls=LinkTls(certificate=authority.issue("bridge")))
    async with Bridge(RecordingRobot(), settings) as bridge:
        for _ in range(2):
            async with RobotLink(*bridge.address, "operator", secret=SECRET, tls=trust) as link:
                assert link.connected


async def test_it_comes_back_to_the_next_bridge_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_RATE", 0.001)
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_BURST", 1)
    authority = Authority(tmp_path)
    trust = LinkTls(authority=authority.certificate).client_context()
    tls = LinkTls(certificate=authority.issue("bridge"))
    settings = BridgeSettings(port=0, secret=SECRET, tls=tls, state_dir=tmp_path / "state")
    async with (
        Bridge(RecordingRobot(), settings) as bridge,
        RobotLink(*bridge.address, "operator", secret=SECRET, tls=trust) as link,
    ):
        assert link.connected
    async with Bridge(RecordingRobot(), settings) as bridge:
        _, stranger = await asyncio.open_connection(
            *bridge.address, ssl=trust, server_hostname="127.0.0.1", local_addr=("127.0.0.2", 0)
        )
        async with RobotLink(*bridge.address, "operator", secret=SECRET, tls=trust) as link:
            assert link.connected
        stranger.transport.abort()
