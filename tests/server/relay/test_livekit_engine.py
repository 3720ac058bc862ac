"""A real console publishes with LiveKit's real client; a stand-in takes it where there is no server (tests/support)."""

import asyncio
import socket
import struct
from typing import Any

import msgspec
import pytest
from aiortc.rtp import RtpPacket
from livekit.api import TokenVerifier

from robot_bridge.protocol.carriers import split_trailer
from server.relay import desk
from server.relay.desk import ENDED
from tests.server.rig import Rig, TestPeer, running_rig
from tests.server.watch_lines import ticket as watch_ticket
from tests.support.livekit_stand_in import KEY, SECRET, LiveKitStandIn, livekit_stand_in

KEYS = {"relay_key": KEY, "relay_secret": SECRET}


async def _ticket(rig: Rig, lost: str = "") -> dict[str, Any]:
    """Asked for until the relay carries the session: the first who ask may be served directly."""
    async with asyncio.timeout(60):
        while True:
            query = {"lost": lost} if lost else {}
            answer = await rig.http.get("/api/relay", params=query, headers=rig.token("observer"), timeout=20)
            found: dict[str, Any] | None = answer.json()["relay"]
            if found is not None:
                return found


async def _with_token(rig: Rig) -> dict[str, Any]:
    """As an observer that is connected gets it."""
    peer, known = TestPeer(), set(rig.services.console.peers)
    try:
        await peer.join(rig, rig.token("observer"), ("session",), "/whep?relay=0")
        (own,) = set(rig.services.console.peers) - known
        stranger = await rig.http.get("/api/relay", params={"peer": own.id}, headers=rig.token("observer"))
        assert stranger.json()["relay"]["token"] == "", "somebody else's peer is nobody's key"
        answer = await rig.http.get("/api/relay", params={"peer": own.id}, headers=peer.headers)
        found: dict[str, Any] = answer.json()["relay"]
        return found
    finally:
        await peer.close()


async def _only_on_the_way(rig: Rig) -> None:
    """Whoever has asked for a place and opens no line takes no part, and gets no key."""
    headers, known = rig.token("observer"), set(rig.services.console.peers)
    await watch_ticket(rig, headers)
    (waiting,) = set(rig.services.console.peers) - known
    answer = await rig.http.get("/api/relay", params={"peer": waiting.id}, headers=headers)
    assert answer.json()["relay"]["token"] == ""


def _relay(server: LiveKitStandIn, **settings: Any) -> dict[str, Any]:
    return {"relay": f"livekit:{server.url}?room=demo", "observers_direct": 0, **KEYS, **settings}


@pytest.mark.parametrize("codec", ["VP8", "H264"])
async def test_every_encoded_picture_carries_its_event_and_feedback_and_sound_are_messages(codec: str) -> None:
    events: list[int] = []

    def take(_name: str, packet: RtpPacket) -> None:
        trailer = split_trailer(packet.payload)[1] if packet.marker else None
        if packet.marker:
            events.append(trailer.event or 0 if trailer is not None else 0)

    async with livekit_stand_in() as server, running_rig(**_relay(server, relay_codec=codec)) as rig:
        server.payloads = take
        ticket = await _ticket(rig)
        assert (ticket["engine"], ticket["url"], ticket["publisher"]) == ("livekit", server.url, "lockstep")
        videos = [each for each in ticket["streams"] if each["kind"] == "video"]
        assert videos
        assert all(each["carrier"] == "trailer" for each in ticket["streams"])
        assert {each["codec"] for each in videos} == {codec}
        (publisher,) = server.members
        assert {track.info.name for track in publisher.tracks} == {each["stream"] for each in videos}
        assert not any(track.info.packet_trailer_features for track in publisher.tracks), "a server would strip it"
        await server.until(lambda: len(events) >= 5, 30)
        assert all(events), "no picture without its event"
        async with rig.peer("observer") as peer:
            newest = (await peer.feedback()).event
        assert max(events) <= newest + 1
        await server.until(lambda: any(topic == "feedback" for topic, _ in server.data))
        heard = [msgspec.json.decode(data) for topic, data in server.data if topic == "feedback"]
        assert all(isinstance(each, dict) and "type" in each for each in heard)
        await server.until(lambda: any(topic == "sound" for topic, _ in server.data))
        sound = next(data for topic, data in server.data if topic == "sound")
        track, _, length = struct.unpack("!BIH", sound[:7])
        assert ticket["streams"][track]["kind"] == "audio"
        trailer = split_trailer(sound[7 : 7 + length])[1]
        assert trailer is not None
        assert trailer.event


async def test_a_ticket_lets_in_to_watch_one_publication_and_the_next_one_has_another_room() -> None:
    verifier = TokenVerifier(KEY, SECRET)
    async with livekit_stand_in() as server, running_rig(**_relay(server)) as rig:
        first = await _ticket(rig)
        assert first["token"] == "", "nobody gets in who takes no part"
        await _only_on_the_way(rig)
        claims = verifier.verify((await _with_token(rig))["token"])
        assert claims.video is not None
        assert claims.video.room == f"demo-{first['feed']:x}" == server.members[0].room
        assert (claims.video.can_publish, claims.video.can_publish_data) == (False, False)
        assert verifier.verify((await _with_token(rig))["token"]).identity != claims.identity
        rig.services.relays._restart(ENDED)
        second = await _ticket(rig, f"0-{first['feed']}")
        assert second["feed"] != first["feed"]
        await server.until(lambda: [each.room for each in server.members] == [f"demo-{second['feed']:x}"])


async def test_it_publishes_only_while_somebody_wants_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk, "LINGER_SECONDS", 0.1)
    monkeypatch.setattr("server.relay.handout.PENDING_SECONDS", 0.5)
    async with livekit_stand_in() as server, running_rig(**_relay(server)) as rig:
        assert not server.claims
        await _ticket(rig)
        assert len(server.members) == 1
        await server.until(lambda: not server.members, 30)
        assert rig.services.relays.stations[0].feed == 0
        assert rig.services.relays.stations[0].failed_at == float("-inf"), "no fault of the relay"


async def test_when_it_dies_observers_are_served_directly_and_it_is_tried_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(desk, "WAIT_SECONDS", 0.5)
    async with livekit_stand_in() as server, running_rig(**_relay(server)) as rig:
        ticket = await _ticket(rig)
        server.accepts = False
        await server.members[0].socket.close()
        lost = {"lost": f"0-{ticket['feed']}"}
        async with asyncio.timeout(30):
            while rig.services.relays.stations[0].live:
                answer = await rig.http.get("/api/relay", params=lost, headers=rig.token("observer"), timeout=20)
                assert answer.json() == {"relay": None}
        assert rig.services.relays.stations[0].trouble
        server.accepts = True
        assert (await _ticket(rig))["feed"] != ticket["feed"]


async def test_an_observer_is_served_directly_when_no_livekit_can_be_reached() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    relay = {"relay": f"livekit:ws://127.0.0.1:{port}?room=demo", "observers_direct": 0, **KEYS}
    async with running_rig(**relay) as rig:
        answer = await rig.http.get("/api/relay", headers=rig.token("observer"), timeout=30)
        assert answer.json() == {"relay": None}
        station = rig.services.relays.stations[0]
        async with asyncio.timeout(30):
            while not station.trouble:
                await rig.http.get("/api/relay", headers=rig.token("observer"), timeout=30)
        assert station.trouble.startswith("unreachable")
        assert SECRET not in station.trouble
