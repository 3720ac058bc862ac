"""Who waits for whom while a crowd of observers has more to say than the console can hear."""

import asyncio

import pytest

from lockstep.protocol.console import Role, Seat, SeatRequest
from lockstep.protocol.messages import Ping, Pong, Stop, StopTaken
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.util.cooperative_scheduler import turns_of_loop
from tests.server.rig import PATIENCE, running_rig

CROWD = 200
PRESS = "5f" * 16


class _Talker:
    """An observer of whom there is always another datagram."""

    def __init__(self) -> None:
        self.handled = 0
        self.goes_on = True

    def handle_next(self) -> bool:
        self.handled += 1
        return self.goes_on


async def test_it_waits_behind_the_crowd_on_its_channel_and_for_nobody_over_http_and_is_one_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the page does: it says each press on its channels and over HTTP at the same moment."""
    crowd = [_Talker() for _ in range(CROWD)]
    async with running_rig() as rig, rig.peer("observer") as peer:
        turns = rig.dependencies.media.datagrams.observers
        monkeypatch.setattr(turns_of_loop(), "is_over", lambda: True)  # one datagram in each turn of the loop
        for each in crowd:
            turns.add(each)
        before = sum(each.handled for each in crowd)
        peer.send("stop", Stop(press=PRESS))
        answer = await rig.http.post("/api/stop", headers=peer.headers, json={"press": PRESS})
        rounds = (sum(each.handled for each in crowd) - before) / CROWD
        assert (answer.status_code, answer.json()["press"]) == (200, PRESS)
        assert rounds < 1, "it did not even wait for each of them once"
        assert rig.dependencies.console.peers.places.taken == 1
        for each in crowd:
            each.goes_on = False
        async with asyncio.timeout(PATIENCE):
            taken = await peer.until(lambda each: isinstance(each, StopTaken))
        assert isinstance(taken, StopTaken)
        assert (taken.press, taken.number) == (PRESS, answer.json()["number"])


@pytest.mark.parametrize("role", ["operator", "supervisor"])
async def test_of_whoever_may_drive_it_waits_for_no_crowd_on_its_channel_either(
    role: Role, monkeypatch: pytest.MonkeyPatch
) -> None:
    crowd = [_Talker() for _ in range(CROWD)]
    async with running_rig() as rig, rig.peer(role) as peer:
        turns = rig.dependencies.media.datagrams.observers
        monkeypatch.setattr(turns_of_loop(), "is_over", lambda: True)
        for each in crowd:
            turns.add(each)
        before = sum(each.handled for each in crowd)
        peer.send("stop", Stop(press=PRESS))
        async with asyncio.timeout(PATIENCE):
            await peer.until(lambda each: isinstance(each, StopTaken))
        rounds = (sum(each.handled for each in crowd) - before) / CROWD
        for each in crowd:
            each.goes_on = False
        assert rounds < 1, "it waited for each of them once"


async def test_of_operators_who_flood_only_whoever_drives_does_not_wait_for_the_crowd(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One link may have a hundred connections; what all of them may send at once is bounded in all."""
    crowd = [_Talker() for _ in range(CROWD)]
    async with running_rig() as rig, rig.peer("operator") as driver, rig.peer("operator") as other:
        driver.send("session", SeatRequest())
        async with asyncio.timeout(PATIENCE):
            await driver.until(lambda each: isinstance(each, Seat) and each.holder != "")
        turns = rig.dependencies.media.datagrams.observers
        monkeypatch.setattr(turns_of_loop(), "is_over", lambda: True)
        used_up = TokenBucket(0.001, 0.0)  # others have sent too much
        monkeypatch.setattr(rig.dependencies.media.datagrams, "_not_driving", used_up)
        for each in crowd:
            turns.add(each)
        rounds = []
        for peer in (driver, other):
            before = sum(each.handled for each in crowd)
            peer.send("control", Ping(id=7))
            async with asyncio.timeout(PATIENCE):
                await peer.until(lambda each: isinstance(each, Pong) and each.id == 7)
            rounds.append((sum(each.handled for each in crowd) - before) / CROWD)
        for each in crowd:
            each.goes_on = False
        assert rounds[0] < 1, "who drives waited for each of them once"
        assert rounds[1] >= 0.9, "the other one went before them"
