"""The board on a real Redis."""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.federation.redis import stop_exchange
from lockstep.server.stop.stop_presses import new_press
from tests.server.federation.boards import running_board, tile
from tests.support.redis_server import RedisServer
from tests.waiting import eventually

ANN = Actor("Ann", "operator", "peer", "link")
PRESS = "5f" * 16


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[RedisServer]:
    async with RedisServer(tmp_path) as running:
        yield running


async def test_each_console_sees_the_others_robots_and_their_changes_at_once(server: RedisServer) -> None:
    async with running_board(server.url, "one", tile("left")) as one, running_board(server.url, "two") as two:
        await eventually(two.others)
        seen = two.others()[0]
        assert (seen.name, seen.url, seen.console) == ("left", "https://one.example/robots/left/", one.name)
        assert two.state.unknown_since is None
        one.publish([tile("left", driver="Ann", stopped=True, event=12)])
        await eventually(lambda: two.others()[0].driver == "Ann")
        assert two.others()[0].stopped
        assert one.others() == []


async def test_a_console_that_ends_in_good_order_takes_its_robots_with_it(server: RedisServer) -> None:
    async with running_board(server.url, "two") as two:
        async with running_board(server.url, "one", tile("left")):
            await eventually(two.others)
        await eventually(lambda: not two.others())


async def test_a_stop_reaches_the_robot_of_another_console_once_and_is_answered(server: RedisServer) -> None:
    async with (
        running_board(server.url, "one", tile("left"), tile("right")) as one,
        running_board(server.url, "two", tile("far")) as two,
    ):
        await eventually(lambda: len(two.others()) == 2)
        one.host.away.add("right")
        answers = await two.stop(["left", "right"], new_press(ANN, "http", "smoke", PRESS))
        assert one.host.stops == [("left", "Ann", "smoke"), ("right", "Ann", "smoke")]
        assert answers["left"] == (True, True, 7, "", 3, True)
        assert one.host.presses == [PRESS, PRESS], "the press of whoever asked"
        assert (answers["right"].confirmed, answers["right"].delivered) == (True, False)
        assert "sent first when the robot link is back" in answers["right"].detail


async def test_a_stop_that_nobody_answers_is_said_to_be_not_confirmed(
    server: RedisServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_exchange, "STOP_PATIENCE", 0.5)
    async with running_board(server.url, "two") as two:
        await eventually(lambda: two.state.unknown_since is None)
        answers = await two.stop(["left"], new_press(ANN, "http", ""))
        assert answers["left"][:2] == (False, False)
        assert answers["left"].detail == "not confirmed: no console has this robot"
        server.kill()
        await eventually(lambda: two.state.unknown_since is not None)
        answers = await two.stop(["left"], new_press(ANN, "http", ""))
        assert answers["left"].detail.startswith("not confirmed: other consoles are unknown (unreachable")


async def test_a_flood_of_stops_keeps_nobody_elses_stop_from_the_robot(
    server: RedisServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_exchange, "MAX_STOPS", 1)
    async with running_board(server.url, "one", tile("left")) as one, running_board(server.url, "two") as two:
        await eventually(two.others)
        flood = asyncio.create_task(two.stop(["nobodys"], new_press(Actor("Mallory"), "http", "")))
        await asyncio.sleep(0)
        answers = await two.stop(["left"], new_press(ANN, "http", "smoke"))
        assert not answers["left"].confirmed
        await eventually(lambda: one.host.stops == [("left", "Ann", "smoke")])
        flood.cancel()


async def test_audit_records_of_all_consoles_are_merged_by_time(server: RedisServer) -> None:
    def record(n: int, time: float) -> AuditRecord:
        return AuditRecord(n=n, time=time, kind="note", who="Ann", detail="ä\nb")

    async with running_board(server.url, "one") as one, running_board(server.url, "two") as two:
        one.record("left", record(1, 10.0))
        two.record("far", record(1, 11.0))
        one.record("left", record(2, 12.0))
        async with asyncio.timeout(20):
            while len((found := await two.audit(10)).records) < 3:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        assert [(each.robot, each.record.n, each.console) for each in found.records] == [
            ("left", 1, one.name),
            ("far", 1, two.name),
            ("left", 2, one.name),
        ]
        assert found.complete
        assert found.records[0].record == record(1, 10.0)
        assert len((await two.audit(2)).records) == 2


async def test_a_link_that_is_revoked_at_one_console_is_revoked_at_the_others_also_later_ones(
    server: RedisServer,
) -> None:
    async with running_board(server.url, "one") as one, running_board(server.url, "two") as two:
        await eventually(lambda: two.state.unknown_since is None)
        one.links.revoke("abc")
        await eventually(lambda: "abc" in two.links.elsewhere)
        assert "abc" not in one.links.elsewhere
    async with running_board(server.url, "three") as three:
        await eventually(lambda: "abc" in three.links.elsewhere)


async def test_a_revocation_while_redis_was_away_comes_when_it_is_back_and_a_lost_list_is_made_again(
    server: RedisServer,
) -> None:
    async with running_board(server.url, "one") as one, running_board(server.url, "two") as two:
        await eventually(lambda: one.state.unknown_since is None and two.state.unknown_since is None)
        one.links.revoke("early")
        await eventually(lambda: "early" in two.links.elsewhere)
        server.kill()
        await eventually(lambda: one.state.unknown_since is not None)
        one.links.revoke("late")
        await server.start()
        await eventually(lambda: "late" in two.links.elsewhere)
    async with running_board(server.url, "three") as three:
        await eventually(lambda: three.links.elsewhere.keys() == {"early", "late"})


async def test_two_living_consoles_that_claim_one_robot_both_say_so_and_the_log_does(server: RedisServer) -> None:
    with capture_logs() as logs:
        async with running_board(server.url, "one", tile("left")) as one:
            async with running_board(server.url, "two", tile("left")) as two:
                await eventually(lambda: one.state.conflicts and two.state.conflicts)
                (conflict,) = one.state.conflicts
                assert conflict == two.state.conflicts[0]
                assert (conflict.error, conflict.robot) == ("robot_claimed_twice", "left")
                assert conflict.consoles == (one.name, two.name)
                assert two.others() == [], "an own robot is not shown as somebody else's too"
                answers = await two.stop(["left"], new_press(ANN, "http", ""))
                assert answers["left"].confirmed
                await eventually(lambda: _named(logs) == 2)
            await eventually(lambda: not one.state.conflicts)


def _named(logs: Sequence[Mapping[str, object]]) -> int:
    return sum(each.get("error") == "robot_claimed_twice" and each.get("robot") == "left" for each in logs)


async def test_whom_one_console_silences_the_others_silence_too_and_hear_again_with_it(server: RedisServer) -> None:
    until = round(time.time() + 300, 3)
    async with (
        running_board(server.url, "one", tile("left")) as one,
        running_board(server.url, "two", tile("far")) as two,
    ):
        one.host.silenced = {"link": until}
        await eventually(lambda: two.host.elsewhere.get(one.id) == {"link": until})
        one.host.silenced = {}
        await eventually(lambda: two.host.elsewhere.get(one.id) == {})
