"""Our agent and aioice's, over UDP on loopback."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import aioice
import pytest

from lockstep.rtc.addresses import Datagram
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import parse_candidate
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.events import PathChanged
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.sockets.udp_socket import UdpSocket
from tests.rtc.ice.sockets import AgentOnSocket

HOST = "127.0.0.1"


@asynccontextmanager
async def ours(*, controlling: bool) -> AsyncIterator[AgentOnSocket]:
    udp_socket = UdpSocket.bind("0.0.0.0", 0)
    agent = Agent(gather([HOST], udp_socket.address[1]), controlling=controlling)
    async with AgentOnSocket(agent, udp_socket) as shell:
        yield shell


@asynccontextmanager
async def theirs(*, controlling: bool) -> AsyncIterator[aioice.Connection]:
    connection = aioice.Connection(ice_controlling=controlling, use_ipv6=False)
    try:
        await connection.gather_candidates()
        yield connection
    finally:
        await connection.close()


def tell_ours(shell: AgentOnSocket, connection: aioice.Connection, *, with_candidates: bool = True) -> None:
    candidates = [parse_candidate(f"candidate:{each.to_sdp()}") for each in connection.local_candidates]
    credentials = Credentials(connection.local_username, connection.local_password)
    shell.agent.set_remote(credentials, candidates if with_candidates else [], shell.now)
    shell.drain()


async def tell_theirs(connection: aioice.Connection, shell: AgentOnSocket) -> None:
    connection.remote_username = shell.agent.local_credentials.ufrag
    connection.remote_password = shell.agent.local_credentials.password
    for local in shell.agent.local_candidates:
        line = local.candidate.line().removeprefix("candidate:")
        await connection.add_remote_candidate(aioice.Candidate.from_sdp(line))
    await connection.add_remote_candidate(None)


async def exchange(shell: AgentOnSocket, connection: aioice.Connection) -> None:
    """Data both ways; they begin as DTLS does."""
    assert shell.agent.path is not None
    shell._socket.queue([Datagram(b"\x16ours", shell.agent.path)])
    shell._socket.flush()
    assert await asyncio.wait_for(connection.recv(), 20) == b"\x16ours"
    shell.data.clear()
    await connection.send(b"\x16theirs")
    await shell.until(lambda: shell.data == [b"\x16theirs"])


def nominated(shell: AgentOnSocket) -> bool:
    path = shell.agent.path
    return path is not None and PathChanged(path, nominated=True) in shell.events


@pytest.mark.parametrize("we_control", [True, False])
async def test_it_connects_in_both_roles(we_control: bool) -> None:
    async with ours(controlling=we_control) as shell, theirs(controlling=not we_control) as connection:
        await tell_theirs(connection, shell)
        tell_ours(shell, connection)
        await asyncio.wait_for(connection.connect(), 20)
        await shell.until(lambda: nominated(shell))
        await exchange(shell, connection)
        assert shell.agent.path is not None
        assert shell.agent.path.local[0] == HOST, "data leave from the address that was asked"


@pytest.mark.parametrize("both_control", [True, False])
async def test_it_connects_when_both_believe_in_the_same_role(both_control: bool) -> None:
    async with ours(controlling=both_control) as shell, theirs(controlling=both_control) as connection:
        await tell_theirs(connection, shell)
        tell_ours(shell, connection)
        await asyncio.wait_for(connection.connect(), 20)
        await shell.until(lambda: nominated(shell))
        assert shell.agent.role.controlling is not connection.ice_controlling
        await exchange(shell, connection)


async def test_it_is_found_by_its_checks_alone() -> None:
    async with ours(controlling=False) as shell, theirs(controlling=True) as connection:
        await tell_theirs(connection, shell)
        tell_ours(shell, connection, with_candidates=False)
        await asyncio.wait_for(connection.connect(), 20)
        await shell.until(lambda: nominated(shell))
        await exchange(shell, connection)


@pytest.mark.parametrize("we_control", [True, False])
async def test_a_restart_moves_to_another_connection_of_theirs(we_control: bool) -> None:
    """aioice restarts by a second connection; ours is the same agent on the same port."""
    async with (
        ours(controlling=we_control) as shell,
        theirs(controlling=not we_control) as first,
        theirs(controlling=not we_control) as second,
    ):
        await tell_theirs(first, shell)
        tell_ours(shell, first)
        await asyncio.wait_for(first.connect(), 20)
        await shell.until(lambda: nominated(shell))
        before = shell.agent.path
        shell.agent.restart(shell.now)
        await tell_theirs(second, shell)
        assert shell.agent.path == before
        await exchange(shell, first)
        tell_ours(shell, second)
        await asyncio.wait_for(second.connect(), 20)
        await shell.until(lambda: shell.agent.path != before and nominated(shell))
        await exchange(shell, second)
        await first.send(b"\x16late")
        await shell.until(lambda: b"\x16late" in shell.data)


async def test_two_of_ours_connect_over_real_sockets_and_restart() -> None:
    async with ours(controlling=True) as here, ours(controlling=False) as there:
        for _ in range(3):
            for one, other in ((here, there), (there, here)):
                candidates = [local.candidate for local in other.agent.local_candidates]
                one.agent.set_remote(other.agent.local_credentials, candidates, one.now)
                one.drain()
            for each in (here, there):
                await each.until(lambda each=each: nominated(each) and each.agent._sessions.next is None)  # type: ignore[misc]
            for each in (here, there):
                each.agent.restart(each.now)
