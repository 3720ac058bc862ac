"""Pins what ice_restart_private.py relies on. How it behaves is tested in tests/client/test_ice_restart.py too."""

import asyncio

import pytest
from aiortc import RTCIceGatherer, RTCPeerConnection

from server.ice_restart_private import MONITOR, IceSession
from tests.server.rig import running_rig

MOVED = "aiortc or aioice moved a private part: see server/ice_restart_private.py"


def _gatherer() -> RTCIceGatherer:
    return RTCIceGatherer(iceServers=[])


async def test_a_connected_transport_has_the_parts_that_a_restart_replaces() -> None:
    async with running_rig() as rig, rig.peer("observer"):
        pc = rig.webrtc_peers[0].pc
        assert pc.sctp is not None
        transport = pc.sctp.transport.transport
        connection = transport._connection
        assert getattr(transport, MONITOR) is not None, MOVED
        assert transport.iceGatherer._connection is connection, MOVED
        assert transport.iceGatherer._remote_candidates_end in (True, False), MOVED
        assert connection._query_consent_task is not None, MOVED
        assert (transport._recv, transport._send) == (connection.recv, connection.send), MOVED
        assert hasattr(connection._queue, "put_nowait"), MOVED


async def test_a_connection_without_sections_has_nothing_to_restart() -> None:
    pc = RTCPeerConnection()
    session = IceSession(pc, "abcd", _gatherer, 1.0, lambda name: None)
    assert not session.connected
    with pytest.raises(ConnectionError):
        await session.restart("other", "x" * 22, [])
    await session.close()
    await pc.close()


async def test_a_restart_that_is_given_up_ends_with_its_session() -> None:
    async with running_rig() as rig:
        async with rig.peer("observer"):
            session = rig.webrtc_peers[0].ice
            before = session.tag
            local = await session.restart("other", "x" * 22, [])
            assert local.candidates
            assert session.tag != before
        async with asyncio.timeout(20):
            await rig.services.console.peers.all_gone()
        await session.close()


async def test_a_gatherer_that_fails_leaves_the_session_as_it_was() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        session = rig.webrtc_peers[0].ice
        before = session.tag

        class Broken(RTCIceGatherer):
            async def gather(self) -> None:
                raise OSError("no socket left")

        session._gatherer = Broken
        with pytest.raises(OSError, match="no socket"):
            await session.restart("other", "x" * 22, [])
        assert session.tag == before
        assert peer.pc.connectionState == "connected"


async def test_restarts_that_overlap_leave_no_socket_behind() -> None:
    async with running_rig() as rig:
        async with rig.peer("observer") as peer:
            session = rig.webrtc_peers[0].ice
            answers = await asyncio.gather(*(session.restart(f"user{each}", "x" * 22, []) for each in range(4)))
            assert len({each.username for each in answers}) == 4
            assert session.username == "user3"
            assert peer.pc.connectionState == "connected"
            ending = asyncio.gather(session.restart("last", "x" * 22, []), session.close(), return_exceptions=True)
            await ending
        with pytest.raises(ConnectionError):
            await session.restart("later", "x" * 22, [])
