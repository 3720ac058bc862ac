"""Two consoles as their users run them, each a process with a simulated robot, behind one Redis."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, NamedTuple, cast

import httpx
import pytest
import pytest_asyncio
from pydantic import SecretStr

from lockstep.bench.harness.driving import drive_on
from lockstep.bench.harness.free_port import free_port
from lockstep.client import Console
from lockstep.client.errors import ConsoleLost
from lockstep.protocol.console import Notice, Role, SilenceStops, Welcome
from lockstep.protocol.messages import Feedback
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state
from tests.server.rig import Rig, TestPeer
from tests.support.redis_server import RedisServer
from tests.support.stack import Stack, running_fleet
from tests.waiting import PATIENCE

pytestmark = pytest.mark.asyncio(loop_scope="module")

SECRET = "one key for all consoles behind one entry"
PASSWORD = "correct-horse-battery-staple"

Answer = dict[str, Any]


class Place(NamedTuple):
    """One console of the two, and its HTTP API with the link of somebody."""

    stack: Stack
    http: httpx.AsyncClient
    state: Path

    def token(self, link: str = "") -> dict[str, str]:
        return {"Authorization": "Bearer " + (link or self.stack.operator).partition("#token=")[2]}

    async def fleet(self) -> Answer:
        answer: Answer = (await self.http.get("/api/fleet", headers=self.token())).json()
        return answer

    async def robot(self, name: str, true: Callable[[Answer], object]) -> Answer:
        """The tile of that robot once it is as wanted."""
        return next(tile for tile in (await self.until(lambda fleet: any(map(true, _named(fleet, name)))))["robots"]
                    if tile["name"] == name)  # fmt: skip

    async def until(self, true: Callable[[Answer], object]) -> Answer:
        seen: Answer = {}
        try:
            async with asyncio.timeout(PATIENCE):
                while not true(seen := await self.fleet()):  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
        except TimeoutError:
            pytest.fail(f"last seen: {seen}")
        return seen

    def invite(self, role: Role) -> tuple[str, str]:
        """As `lockstep invite` beside the console does: the id of a link and its token."""
        state = open_state(Settings(state_dir=self.state, secret=SecretStr(SECRET)))
        made = state.invitations.update(lambda known: known.invite(None, role, "", 3600, time.time()))
        return made.id, state.access.sign(made.identity, made.created)

    def link(self, robot: str) -> str:
        return self.stack.operator.replace("/#", f"/robots/{robot}/#")


class World(NamedTuple):
    redis: RedisServer
    one: Place  # has "left"
    two: Place  # has "right"


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def world(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[World]:
    async with AsyncExitStack() as opened:
        redis = RedisServer(tmp_path_factory.mktemp("redis"), password=PASSWORD)
        await opened.enter_async_context(redis)
        one, two = await asyncio.gather(
            opened.enter_async_context(_place(tmp_path_factory.mktemp("one"), "one", "left", redis)),
            opened.enter_async_context(_place(tmp_path_factory.mktemp("two"), "two", "right", redis)),
        )
        yield World(redis, one, two)


@asynccontextmanager
async def _place(directory: Path, name: str, robot: str, redis: RedisServer) -> AsyncIterator[Place]:
    port = free_port()
    settings = {
        "LOCKSTEP_BOARD": redis.url,
        "LOCKSTEP_SECRET": SECRET,
        "LOCKSTEP_PUBLIC_URL": f"http://127.0.0.1:{port}",
        "LOCKSTEP_CONSOLE_NAME": name,
        "LOCKSTEP_SCENE": "false",
    }
    async with (
        running_fleet(directory, {robot: "planar"}, port=port, settings=settings) as stack,
        httpx.AsyncClient(base_url=stack.console, timeout=PATIENCE) as http,
    ):
        yield Place(stack, http, directory / "state")


def _named(fleet: Answer, name: str) -> list[Answer]:
    return [tile for tile in fleet.get("robots", []) if tile["name"] == name]


async def test_the_overview_of_one_shows_the_others_robot_who_is_there_and_who_drives(world: World) -> None:
    await world.one.robot("right", lambda tile: tile["link"] == "up")
    async with Console(world.two.link("right"), video=False, audio=False, name="Ann") as ann:
        await ann.take_seat()
        await drive_on(ann, {"base.vx": 0.1})
        seen = await world.one.robot("right", lambda tile: tile["driver"] == "Ann" and tile["participant_count"] == 1)
        assert seen["url"] == f"{world.two.stack.console}/robots/right/"
        assert seen["console"].startswith("two-")
        assert seen["participants"] == [{"name": "Ann", "role": "operator", "driving": True}]
    assert [tile["name"] for tile in (await world.two.fleet())["robots"]] == ["left", "right"]
    assert _named(await world.two.fleet(), "right")[0]["url"] == "robots/right/", (
        "an own robot is not on the board twice"
    )
    await world.one.robot("right", lambda tile: not tile["driver"] and tile["participant_count"] == 0)


async def test_a_link_of_one_console_opens_the_other_until_it_is_revoked_where_it_was_made(world: World) -> None:
    made, token = world.one.invite("operator")
    guest = {"Authorization": f"Bearer {token}"}
    session = "/robots/right/api/session"
    assert (await world.two.http.get(session, headers=guest)).status_code == 200
    # the guest invites somebody at the other console, who goes with the guest
    further = await world.two.http.post("/robots/right/api/invitations", headers=guest, json={"role": "observer"})
    friend = world.two.token(further.json()["link"])
    link = f"{world.two.stack.console}/robots/right/#token={token}"
    async with Console(link, video=False, audio=False) as connected:
        supervisor = world.one.token(world.one.stack.supervisor)
        revoked = await world.one.http.delete(f"/robots/left/api/invitations/{made}", headers=supervisor)
        assert revoked.status_code == 200, revoked.text
        with pytest.raises(ConsoleLost):
            await _until(connected, lambda feedback: False)
    for each in (guest, friend):
        async with asyncio.timeout(PATIENCE):
            while (answer := await world.two.http.get(session, headers=each)).status_code == 200:  # noqa: ASYNC110
                await asyncio.sleep(0.02)
        assert (answer.status_code, answer.json()["error"]) == (401, "link_revoked")


async def test_stop_all_at_one_console_stops_the_robot_of_the_other_while_it_drives(world: World) -> None:
    async with Console(world.two.link("right"), video=False, audio=False, name="Ann") as ann:
        await ann.take_seat()
        await drive_on(ann, {"base.vx": 0.1})
        answer = await world.one.http.post("/api/fleet/stop", headers=world.one.token(), json={"reason": "smoke"})
        stopped = {each["name"]: each for each in answer.json()["robots"]}
        assert stopped["left"]["delivered"]
        assert stopped["right"]["delivered"]
        assert stopped["right"]["console"].startswith("two-")
        await _until(ann, lambda feedback: feedback.stop.stopped)
        await world.one.robot("right", lambda tile: tile["stopped"] and tile["stop_reason"] == "smoke")
    for place, robot in ((world.one, "left"), (world.two, "right")):
        await _reset(place, robot)


async def test_supervisors_read_one_audit_of_both_and_nobody_else_does(world: World) -> None:
    supervisor = world.two.token(world.two.stack.supervisor)
    async with Console(world.one.link("left"), video=False, audio=False, name="Bob") as bob:
        await bob.note("the left one squeaks")
        async with asyncio.timeout(PATIENCE):
            while not (found := await _notes(world.two, supervisor)):  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    assert (found[0]["robot"], found[0]["record"]["who"]) == ("left", "Bob")
    assert found[0]["console"].startswith("one-")
    records = (await world.two.http.get("/api/fleet/audit?limit=500", headers=supervisor)).json()["records"]
    keys = [(each["robot"], each["record"]["n"], each["record"]["time"]) for each in records]
    assert len(keys) == len(set(keys)), "each record once"
    assert {each["robot"] for each in records} == {"left", "right"}
    assert [each["record"]["time"] for each in records] == sorted(each["record"]["time"] for each in records)
    assert (await world.two.http.get("/api/fleet/audit", headers=world.two.token())).status_code == 403


async def test_two_go_on_driving_while_redis_is_killed_and_is_back(world: World) -> None:
    async with (
        Console(world.one.link("left"), video=False, audio=False, name="Ann") as ann,
        Console(world.two.link("right"), video=False, audio=False, name="Bob") as bob,
        _driving(ann, "left") as left,
        _driving(bob, "right") as right,
    ):
        await world.one.robot("right", lambda tile: tile["driver"] == "Bob")
        world.redis.kill()
        lost = await world.one.until(lambda fleet: fleet["consoles"]["unknown_since"] is not None)
        assert abs(lost["consoles"]["unknown_since"] - time.time()) < 60
        assert any("Other consoles are unknown since" in notice["text"] for notice in lost["notices"])
        await world.one.robot("right", lambda tile: tile["link"] == "unknown")
        before = left.events, right.events
        await world.redis.start()
        await world.one.robot("right", lambda tile: tile["link"] == "up" and tile["driver"] == "Bob")
        await world.two.until(lambda fleet: fleet["consoles"]["unknown_since"] is None)
        assert left.events > before[0]
        assert right.events > before[1]
        assert (left.seats_lost, right.seats_lost) == (0, 0)


async def test_two_go_on_driving_while_redis_hangs_and_a_stop_is_said_to_be_not_confirmed(world: World) -> None:
    async with Console(world.one.link("left"), video=False, audio=False, name="Ann") as ann:
        async with _driving(ann, "left") as left:
            await world.one.robot("right", lambda tile: tile["link"] == "up")
            world.redis.hang()
            try:
                before = left.events
                await world.one.until(lambda fleet: fleet["consoles"]["unknown_since"] is not None)
                assert left.events > before
                assert left.seats_lost == 0
                left.task.cancel()
                answer = await world.one.http.post("/api/fleet/stop", headers=world.one.token(), json={})
            finally:
                world.redis.go_on()
        stopped = {each["name"]: each for each in answer.json()["robots"]}
        assert stopped["left"]["delivered"], "our own is stopped whatever Redis does"
        assert not stopped["right"]["delivered"]
        assert stopped["right"]["detail"].startswith("not confirmed")
        await world.one.robot("right", lambda tile: tile["link"] == "up")
    await _reset(world.one, "left")


async def test_no_console_has_logged_the_password(world: World) -> None:
    for place in (world.one, world.two):
        assert PASSWORD not in "\n".join(place.stack.output)


class _Driven:
    task: asyncio.Task[None]
    events = 0
    seats_lost = 0


@asynccontextmanager
async def _driving(console: Console, robot: str) -> AsyncIterator[_Driven]:
    """Drives in a circle until it is left; any refusal or loss fails the test."""
    found = _Driven()
    await console.take_seat()

    async def drive() -> None:
        while True:
            await drive_on(console, {"base.vx": 0.05, "base.wz": 0.3})
            found.events += 1
            found.seats_lost += console.seat.holder != console.peer

    async with asyncio.TaskGroup() as tasks:
        found.task = tasks.create_task(drive(), name=robot)
        yield found
        found.task.cancel()


async def _reset(place: Place, robot: str) -> None:
    """Until it is released: a bridge takes no reset within a second of a stop."""
    headers = place.token(place.stack.supervisor)
    async with asyncio.timeout(PATIENCE):
        while (state := (await place.http.get(f"/robots/{robot}/api/session", headers=headers)).json())["stopped"]:
            number = {"number": state["stop"]["number"]}
            await place.http.post(f"/robots/{robot}/api/reset", headers=headers, json=number)
            await asyncio.sleep(0.5)


async def _until(console: Console, true: Callable[[Feedback], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        async for feedback in console.feedbacks():
            if true(feedback):
                return


async def _notes(place: Place, supervisor: Mapping[str, str]) -> list[Answer]:
    answer = await place.http.get("/api/fleet/audit", headers=supervisor)
    assert answer.status_code == 200, answer.text
    return [
        each
        for each in answer.json()["records"]
        if each["record"]["kind"] == "note" and "squeaks" in each["record"].get("detail", "")
    ]


async def test_who_is_silenced_at_one_console_is_silenced_at_the_other_by_every_link_of_theirs(world: World) -> None:
    made, token = world.one.invite("operator")
    bad = {"Authorization": f"Bearer {token}"}
    wanted = {"role": "operator", "seconds": 600, "robots": []}
    below = (await world.two.http.post("/robots/right/api/invitations", headers=bad, json=wanted)).json()["link"]
    sue, mal = TestPeer(), TestPeer()
    try:
        for peer, headers in ((sue, world.one.token(world.one.stack.supervisor)), (mal, bad)):
            await peer.join(cast(Rig, world.one), headers, ("session",), "/robots/left/whep")
        welcome = await mal.until(lambda each: isinstance(each, Welcome))
        sue.send("session", SilenceStops(peer=cast(Welcome, welcome).peer))
        await mal.until(lambda each: isinstance(each, Notice) and "silenced" in each.text)
    finally:
        await sue.close()
        await mal.close()
    ways = [
        (world.one, "left", bad),
        (world.one, "left", world.one.token(below)),
        (world.two, "right", bad),
        (world.two, "right", world.two.token(below)),
    ]
    async with asyncio.timeout(PATIENCE):
        for place, robot, headers in ways:
            while (await place.http.post(f"/robots/{robot}/api/stop", headers=headers)).status_code != 403:  # noqa: ASYNC110
                await asyncio.sleep(0.1)
    refused = await world.two.http.post("/robots/right/api/stop", headers=world.two.token(below))
    assert refused.json()["error"] == "silenced"
