"""The headless client through a real TURN server, with credentials that the console minted."""

import time
from contextlib import AsyncExitStack, suppress
from pathlib import Path

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.client.errors import ConnectFailed
from lockstep.client.transport.webrtc_transport import WebRtcTransport
from lockstep.client.transport.whep import Whep
from lockstep.rtc.addresses import Address
from lockstep.rtc.turn.servers import IceServer
from lockstep.server.auth.tokens import Identity
from lockstep.server.webrtc.ice_servers import turn_credential
from tests.server.rig import PATIENCE, eventually, running_rig
from tests.support.turn_server import TURN_SECRET, TurnServer, running_turn_server

LIVES = (5, 15, 45)  # s, of credentials; the next where a busy machine takes longer than that to connect


async def test_with_only_a_relay_the_robot_is_driven_seen_and_moved_to_another_relay(tmp_path: Path) -> None:
    async with (
        running_turn_server(tmp_path) as turn,
        running_rig(turn=turn.uri, turn_secret=TURN_SECRET, ice_hosts="127.0.0.1") as rig,
        Console(f"{rig.url}/#token={rig.access.issue('operator', 'operator')}", relay_only=True) as console,
    ):
        await console.take_seat()
        rest, forward = ([value] * len(console.description.axes) for value in (0.0, 0.1))
        first = await drive_on(console, rest)
        await drive_on(console, forward)
        async for picture in console.pictures():
            assert picture.stamp is None or picture.stamp >= first.event - 4
            break
        peer = console._live().transport
        assert isinstance(peer, WebRtcTransport)
        before = _relay_in_use(peer)
        await console.restart_ice()
        assert _relay_in_use(peer) != before
        assert (await drive_on(console, forward)).event > first.event
        await console.rest()


def _relay_in_use(peer: WebRtcTransport) -> Address:
    assert peer._connection is not None
    ice = peer._connection.peer.ice
    assert ice.path is not None
    [candidate] = [each.candidate for each in ice.local_candidates if each.base == ice.path.local]
    assert candidate.type == "relay"
    return ice.path.local


async def test_expired_and_forged_credentials_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with (
        running_turn_server(tmp_path) as turn,
        running_rig(turn=turn.uri, turn_secret=TURN_SECRET, ice_hosts="127.0.0.1") as rig,
    ):
        link = f"{rig.url}/#token={rig.access.issue('operator', 'operator')}"
        for secret, expires in ((TURN_SECRET, time.time() - 60), ("somebody else's secret", time.time() + 3600)):
            username, credential = turn_credential(secret, "ann", int(expires))

            async def spoilt(whep: object, username: str = username, credential: str = credential) -> list[IceServer]:
                return [IceServer([turn.uri], username, credential)]

            monkeypatch.setattr("lockstep.client.transport.whep.Whep.ice_servers", spoilt)
            with pytest.raises(ConnectFailed):
                async with Console(link, relay_only=True, connect_seconds=1.5):
                    pass
        assert turn.says("401"), "and it was the credential that it refused"


class ShortLived:
    """Makes the client's first credentials itself, for a short life; once `good` is set they are the console's."""

    def __init__(self, turn: TurnServer, monkeypatch: pytest.MonkeyPatch) -> None:
        self.good = False
        self.renewed = 0  # times that the console was asked
        self.end = 0.0  # UNIX time, s, at which the newest ones end
        ask = Whep.ice_servers

        async def servers(whep: Whep) -> list[IceServer]:
            if self.good:
                self.renewed += 1
                return await ask(whep)
            username, credential = turn_credential(TURN_SECRET, "ann", int(self.end))
            return [IceServer([turn.uri], username, credential)]

        monkeypatch.setattr("lockstep.client.transport.whep.Whep.ice_servers", servers)

    async def connect(self, link: str, exits: AsyncExitStack) -> Console:
        """Return a console whose credentials are about to end."""
        for lives in LIVES:
            self.end = time.time() + lives
            with suppress(ConnectFailed):
                return await exits.enter_async_context(Console(link, relay_only=True))
        raise TimeoutError(f"no connection within {lives} s")


async def test_a_session_outlives_the_credentials_that_it_began_with_and_a_restart_brings_new_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with (
        running_turn_server(tmp_path, "--max-allocate-lifetime=12") as turn,
        running_rig(turn=turn.uri, turn_secret=TURN_SECRET, ice_hosts="127.0.0.1") as rig,
        AsyncExitStack() as exits,
    ):
        credentials = ShortLived(turn, monkeypatch)
        link = f"{rig.url}/#token={rig.access.issue('operator', 'operator')}"
        console = await credentials.connect(link, exits)
        await console.take_seat()
        forward = [0.1] * len(console.description.axes)
        await drive_on(console, [0.0] * len(forward))
        # The allocation is renewed each 6 s, half its lifetime: once more after its credentials' end.
        await eventually(lambda: time.time() > credentials.end + 1, LIVES[-1] + PATIENCE)
        before = turn.log.read_text().count("refreshed")
        await eventually(lambda: turn.log.read_text().count("refreshed") > before)
        await drive_on(console, forward)
        credentials.good = True
        await console.restart_ice()
        assert credentials.renewed == 1
        await drive_on(console, forward)
        await console.rest()


async def test_credentials_end_with_the_link_that_they_are_for() -> None:
    settings = {"turn": "turn:127.0.0.1:9", "turn_secret": TURN_SECRET}
    async with running_rig(**settings) as rig:
        soon = time.time() + 90
        token = rig.access.sign(Identity("observer", "x", "id", soon), time.time())
        for header, ends in ((token, soon), (rig.access.issue("observer", "y"), time.time() + 600)):
            told = (await rig.http.get("/api/ice", headers={"Authorization": f"Bearer {header}"})).json()
            assert told["expires"] == pytest.approx(ends, abs=5)


async def test_the_console_can_be_reached_by_a_relay_of_its_own_and_says_which_servers_there_are(
    tmp_path: Path,
) -> None:
    async with running_turn_server(tmp_path) as turn:
        stun = turn.uri.replace("turn:", "stun:").partition("?")[0]
        settings = {"turn": turn.uri, "turn_secret": TURN_SECRET, "stun": stun, "ice_hosts": "127.0.0.1"}
        async with running_rig(**settings, relay_console=True) as rig, rig.peer("observer") as peer:
            assert "typ relay" in peer.pc.remoteDescription.sdp
            told = (await rig.http.get("/api/ice", headers=peer.headers)).json()
            assert [each["urls"] for each in told["ice_servers"]] == [[stun], [turn.uri]]
            assert told["expires"] > time.time()
            links = peer.answer_headers["link"]
            assert f'<{stun}>; rel="ice-server", <{turn.uri}>; rel="ice-server"; username="' in links


async def test_without_settings_there_are_no_servers() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        told = (await rig.http.get("/api/ice", headers=peer.headers)).json()
        assert told == {"ice_servers": [], "expires": None}
        assert "link" not in peer.answer_headers
