"""A new path under a connection that lives on, between a real console and the headless client."""

import asyncio
import re
import socket

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.client.errors import ConnectFailed, SignallingRefused
from lockstep.client.transport.webrtc_transport import WebRtcTransport
from lockstep.client.transport.whep import Whep
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.peer import PeerSettings
from lockstep.rtc.sdp import Fragment
from lockstep.server.peers.webrtc_transport import WebRtcTransport as TransportAtTheConsole
from tests.server.rig import PATIENCE, Rig, eventually, running_rig

CANDIDATE = re.compile(r"^a=candidate:(\S+ \d+ \S+ \d+) (\S+) (\d+) typ host", re.MULTILINE)

STUN_BELOW = 4  # RFC 7983 7: the first byte of a STUN message


class Paths:
    """A `Route` that sends every ICE session through a forwarder of its own, so that the older ones can be cut."""

    def __init__(self) -> None:
        self.forwarders: list[Forwarder] = []

    def offer(self, sdp: str) -> str:
        """Without candidates: the console is to answer only to where checks come from."""
        kept = [line for line in sdp.splitlines() if not line.startswith(("a=candidate:", "a=end-of-candidates"))]
        return "\r\n".join(kept) + "\r\n"

    def answer(self, sdp: str) -> str:
        found = CANDIDATE.search(sdp)
        assert found is not None, sdp
        forwarder = Forwarder((found[2], int(found[3])))
        self.forwarders.append(forwarder)
        return CANDIDATE.sub(rf"a=candidate:\1 127.0.0.1 {forwarder.port} typ host", sdp)

    def close(self) -> None:
        for forwarder in self.forwarders:
            forwarder.cut()


class Forwarder:
    """Passes datagrams between whoever writes to `port` and the console, until it is cut."""

    def __init__(self, console: tuple[str, int]) -> None:
        self.passed = 0
        self.checks_pass = True  # whether what the client says of the path, in STUN, reaches the console
        self._here, self._there = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._client: tuple[str, int] | None = None
        self._console = console
        self._loop = asyncio.get_running_loop()
        for each in (self._here, self._there):
            each.bind(("127.0.0.1", 0))
            each.setblocking(False)
        self.port: int = self._here.getsockname()[1]
        self._loop.add_reader(self._here, self._from_client)
        self._loop.add_reader(self._there, self._from_console)

    def _from_client(self) -> None:
        data, self._client = self._here.recvfrom(2048)
        self.passed += 1
        if data[0] < STUN_BELOW and not self.checks_pass:
            return
        self._there.sendto(data, self._console)

    def _from_console(self) -> None:
        data = self._there.recv(2048)
        if self._client is not None:
            self._here.sendto(data, self._client)

    def cut(self) -> None:
        """Idempotent."""
        if self._here.fileno() < 0:
            return
        for each in (self._here, self._there):
            self._loop.remove_reader(each)
            each.close()


def _link(rig: Rig) -> str:
    return f"{rig.url}/#token={rig.access.issue('operator', 'operator')}"


async def test_after_the_path_is_cut_a_restart_brings_commands_and_pictures_back_on_the_same_connection() -> None:
    paths = Paths()
    async with running_rig(ice_hosts="127.0.0.1") as rig:
        try:
            async with Console(_link(rig), route=paths) as console:
                await console.take_seat()
                values = [0.1] * len(console.description.axes)
                before = await drive_on(console, values)
                peer = console.peer
                paths.forwarders[0].cut()
                waiting = asyncio.create_task(drive_on(console, values))
                await console.restart_ice()
                async with asyncio.timeout(PATIENCE):
                    after = await waiting
                    async for picture in console.pictures():
                        if picture.stamp is not None and picture.stamp >= after.event:
                            break
                assert after.event > before.event, "events go on where they were"
                assert console.peer == peer
                assert console.seat.holder == peer, "and nobody else could drive meanwhile"
                assert len(rig.dependencies.console.peers) == 1
                await console.rest()
                assert paths.forwarders[1].passed > 0
                assert rig.count("lockstep_rests_total", why="disconnected") == 0
        finally:
            paths.close()


async def test_a_restart_that_finds_no_path_leaves_the_old_one_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    restart_ice = WebRtcTransport.restart_ice

    async def hasty(peer: WebRtcTransport, seconds: float) -> None:
        await restart_ice(peer, 2.0)

    monkeypatch.setattr(WebRtcTransport, "restart_ice", hasty)

    class Nowhere(Paths):
        def answer(self, sdp: str) -> str:
            sent = super().answer(sdp)
            if len(self.forwarders) > 1:
                self.forwarders[1].cut()
            return sent

    paths = Nowhere()
    async with running_rig(ice_hosts="127.0.0.1") as rig:
        try:
            async with Console(_link(rig), route=paths) as console:
                await console.take_seat()
                with pytest.raises(ConnectFailed):
                    await console.restart_ice()
                feedback = await drive_on(console, [0.0] * len(console.description.axes))
                assert feedback.event > 1
        finally:
            paths.close()


@pytest.fixture
def hasty_consent(monkeypatch: pytest.MonkeyPatch) -> None:
    hasty = PeerSettings(ice=IceSettings(consent_seconds=1.0, consent_interval=(0.05, 0.1), connect_seconds=5.0))
    monkeypatch.setattr("lockstep.server.routes.webrtc.whep.OF_DRIVERS", hasty)


async def _lapse(rig: Rig, paths: Paths) -> None:
    """The old path carries everything but STUN, and nobody consents on it, while a restart is under way."""
    transport = rig.webrtc_peers[0].transport
    assert isinstance(transport, TransportAtTheConsole)
    session = transport.ice
    session.restart(Fragment("somebody", "x" * 22))
    paths.forwarders[0].checks_pass = False
    await eventually(lambda: not session.has_path)


@pytest.mark.usefixtures("hasty_consent")
async def test_an_old_path_without_answers_ends_nothing_while_a_restart_is_under_way() -> None:
    paths = Paths()
    async with running_rig(ice_hosts="127.0.0.1") as rig:
        try:
            async with Console(_link(rig), route=paths, video=False, audio=False) as console:
                await console.take_seat()
                values = [0.1] * len(console.description.axes)
                before = await drive_on(console, values)
                await _lapse(rig, paths)
                await console.restart_ice()
                after = await drive_on(console, values)
                assert after.event > before.event
                assert len(rig.dependencies.console.peers) == 1
                assert rig.count("lockstep_rests_total", why="disconnected") == 0
        finally:
            paths.close()


@pytest.mark.usefixtures("hasty_consent")
async def test_a_restart_that_finds_no_path_ends_a_session_whose_old_path_gives_no_answers() -> None:
    paths = Paths()
    async with running_rig(ice_hosts="127.0.0.1") as rig:
        try:
            async with Console(_link(rig), route=paths, video=False, audio=False):
                await _lapse(rig, paths)
                async with asyncio.timeout(PATIENCE):
                    await rig.dependencies.console.peers.all_gone()
        finally:
            paths.close()


async def test_the_path_can_be_changed_again_and_again_without_a_repeat() -> None:
    async with running_rig(ice_hosts="127.0.0.1") as rig, Console(_link(rig), video=False, audio=False) as console:
        await console.take_seat()
        values = [0.1] * len(console.description.axes)
        events = [(await drive_on(console, values)).event]
        for _ in range(3):
            await console.restart_ice()
            for _ in range(5):
                events.append((await drive_on(console, values)).event)
        assert events == sorted(set(events))  # in between are the neutral ones of a long pause


async def test_a_session_that_has_ended_is_not_restarted() -> None:
    async with running_rig() as rig, Console(_link(rig), video=False, audio=False) as console:
        next(iter(rig.dependencies.console.peers)).end("for the test")
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.peers.all_gone()
        with pytest.raises(SignallingRefused, match="not_found"):
            await console.restart_ice()


async def test_an_answer_that_cannot_be_used_leaves_the_old_path_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_rig() as rig, Console(_link(rig), video=False, audio=False) as console:
        await console.take_seat()
        for answer in ("a=ice-ufrag:abcd\r\n", "what", "a=ice-ufrag:a b\r\na=ice-pwd:c\r\n"):

            async def spoilt(whep: Whep, resource: str, fragment: str, answer: str = answer) -> str:
                return answer

            monkeypatch.setattr("lockstep.client.transport.whep.Whep.restart_ice", spoilt)
            with pytest.raises(ConnectFailed):
                await console.restart_ice()
        await console.drive([0.0] * len(console.description.axes))
