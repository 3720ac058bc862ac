"""A robot's session that fails, and what is kept for the next one."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import viser
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Subprotocol

from lockstep.protocol.console import Notice, SilenceStops
from lockstep.protocol.serial import event_after
from lockstep.server.audit.records import Actor
from lockstep.server.composition.robot_session import running_session
from lockstep.server.control.console import Console
from lockstep.server.fleet import session
from lockstep.server.fleet.summaries import FAILED
from lockstep.server.recording.service import RecordingService
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.stop.stop_presses import MAX_PENDING, new_press
from tests.server.fleet.rig import FleetRig, drive_once, running_fleet, running_fleet_rig
from tests.server.rig import PATIENCE, eventually, reset_by_http, running_bridge, stop_words


class Faults:
    """Ends a robot's session by a fault, when told to."""

    def __init__(self) -> None:
        self._told: dict[Console, asyncio.Event] = {}
        self.may_begin = asyncio.Event()  # the next session
        self.may_begin.set()

    async def until_told(self, console: Console) -> None:
        told = self._told[console] = asyncio.Event()
        await told.wait()
        raise RuntimeError("a fault of ours")

    async def end(self, rig: FleetRig, name: str) -> None:
        """Returns while there is no session, and there is none until `back`."""
        self.may_begin.clear()
        self._told[rig.session(name).console].set()
        await eventually(lambda: rig.fleet.sessions[name].dependencies is None)

    async def back(self, rig: FleetRig, name: str) -> None:
        """Until the next session has reached its robot."""
        self.may_begin.set()
        await eventually(lambda: rig.fleet.sessions[name].dependencies is not None)
        await rig.all_reached()


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> Faults:
    made = Faults()

    serve = Console.run

    async def run(console: Console) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(serve(console))
            await made.until_told(console)

    @asynccontextmanager
    async def running(*arguments: Any) -> AsyncIterator[Dependencies]:
        await made.may_begin.wait()
        async with running_session(*arguments) as dependencies:
            yield dependencies

    monkeypatch.setattr(Console, "run", run)
    monkeypatch.setattr(session, "running_session", running)
    return made


def _stops(rig: FleetRig, name: str) -> list[tuple[str, str]]:
    """Who stopped this robot and by which way, as its audit has it."""
    return [(each.who, each.what) for each in rig.session(name).audit.tail if each.kind == "stop"]


async def test_a_session_that_fails_is_started_again_and_no_other_notices(faults: Faults) -> None:
    async with (
        # The driver is silent meanwhile, which on a busy machine takes longer than a seat is kept.
        running_fleet_rig("left", "right", seat_timeout=120.0) as rig,
        rig.peer("left", "operator") as lost,
        rig.peer("right", "operator") as peer,
    ):
        event = await drive_once(peer)
        untouched = rig.session("right")
        await faults.end(rig, "left")
        tile = (await rig.tiles())["left"]
        assert (tile["link"], tile["trouble"]) == ("down", FAILED)
        answer = await rig.http.get("/robots/left/api/session", headers=rig.token("observer"))
        assert (answer.status_code, answer.json()["error"]) == (503, "robot_failed")
        kept = await rig.http.post("/api/fleet/stop", headers=rig.token("operator", "left"))
        assert kept.json()["robots"][0]["delivered"] is False
        await faults.back(rig, "left")
        await eventually(lambda: rig.session("left").console.clock.stop.stopped)
        async with asyncio.timeout(PATIENCE):
            await lost.closed.wait()
        text = (await rig.http.get("/metrics")).text
        assert 'lockstep_fleet_session_failures_total{robot="left"} 1.0' in text
        assert rig.session("right") is untouched
        assert not peer.closed.is_set()
        assert (await peer.drive([0.0, 0.0, 0.0])).event == event_after(event)


async def test_a_stop_at_a_robot_whose_session_has_failed_is_kept_and_done_first_by_the_next(faults: Faults) -> None:
    async with running_fleet_rig("left") as rig:
        await faults.end(rig, "left")
        answer = await rig.http.post(
            "/robots/left/api/stop", headers=rig.token("observer", "left"), json={"reason": "smoke"}
        )
        assert (answer.status_code, answer.json()["error"]) == (503, "link_down")
        assert "kept" in answer.json()["detail"]
        await faults.back(rig, "left")
        console = rig.session("left").console
        await eventually(lambda: stop_words(console.clock.stop) == ("observer", "smoke"))
        await eventually(lambda: bool(_stops(rig, "left")))
        who, what = _stops(rig, "left")[0]
        assert who == "observer"
        assert what.startswith(f"http, sent again, stop {console.clock.stop.number}")
        await reset_by_http(rig.http, "/robots/left/api/reset", rig.token("supervisor"), lambda: console.clock.stop)


async def test_the_scene_of_a_robot_whose_session_fails_ends_and_opens_for_nobody_until_it_is_back(
    faults: Faults,
) -> None:
    async with running_fleet_rig("left", scene=True) as rig:
        headers = rig.token("observer")
        path = (await rig.http.post("/robots/left/api/scene", headers=headers)).json()["path"]
        address, version = path.split("websocket=")[1].split("&")[0], Subprotocol(f"viser-v{viser.__version__}")
        async with connect(address, subprotocols=[version], proxy=None, max_size=None) as stream:
            await faults.end(rig, "left")
            async with asyncio.timeout(PATIENCE):
                await stream.wait_closed()
        with pytest.raises(InvalidStatus):
            await connect(address, subprotocols=[version], proxy=None)
        assert (await rig.http.get(path)).json()["error"] == "robot_failed"
        await faults.back(rig, "left")
        async with asyncio.timeout(PATIENCE), connect(address, subprotocols=[version], proxy=None, max_size=None):
            pass


async def test_who_may_not_stop_a_robot_may_not_while_its_session_has_failed(faults: Faults) -> None:
    async with running_fleet_rig("left", "right") as rig:
        await faults.end(rig, "left")
        for headers, error in (({}, "unauthorized"), (rig.token("operator", "right"), "link_other_robot")):
            answer = await rig.http.post("/robots/left/api/stop", headers=headers)
            assert answer.json()["error"] == error
        await faults.back(rig, "left")
        assert _stops(rig, "left") == []
        assert not rig.session("left").console.clock.stop.stopped


async def test_a_silence_outlives_the_session_of_the_robot_where_it_was_said(faults: Faults) -> None:
    async with running_fleet_rig("left") as rig:
        async with rig.peer("left", "supervisor") as supervisor, rig.peer("left", "observer") as loud:
            here = next(each for each in rig.session("left").console.peers if each.role == "observer")
            supervisor.send("session", SilenceStops(peer=here.id))
            await loud.until(lambda each: isinstance(each, Notice))
            await faults.end(rig, "left")
        await faults.back(rig, "left")
        refused = await rig.http.post("/robots/left/api/stop", headers=loud.headers)
        assert (refused.status_code, refused.json()["error"]) == (403, "silenced")


async def test_a_stop_that_the_robot_has_not_heard_of_outlives_a_session_that_fails(faults: Faults) -> None:
    async with running_bridge() as first:
        port = first.address[1]
        async with running_fleet({"left": port}) as rig:
            await rig.all_reached()
            await first.close()
            await eventually(lambda: not rig.session("left").console.robot.up)
            rig.session("left").console.stops.stop(new_press(Actor("Ann"), "stop", "smoke", "5f" * 16))
            await faults.end(rig, "left")
            async with running_bridge(port):
                await faults.back(rig, "left")
                clock = rig.session("left").console.clock
                await eventually(lambda: clock.stop.stopped)
                assert (clock.stop.by, clock.stop.reason, clock.stop.press) == ("Ann", "smoke", "5f" * 16)
                kept, sent = _stops(rig, "left")
                assert kept == ("Ann", "stop, not delivered yet")
                assert sent[1].startswith(f"stop, sent again, stop {clock.stop.number}")


async def test_stops_without_end_at_a_robot_whose_session_has_failed_fill_no_disk(
    faults: Faults, tmp_path: Path
) -> None:
    def files() -> int:
        return len(list(tmp_path.rglob("kept-stops/*/*.json")))

    async with running_bridge() as gone:
        port = gone.address[1]
    async with running_fleet({"left": port}, state_dir=tmp_path) as rig:
        await faults.end(rig, "left")
        left = rig.fleet.sessions["left"]
        presses = [new_press(Actor("Ann"), "http", "smoke") for _ in range(3 * MAX_PENDING)]
        await asyncio.gather(*(left.stop(press) for press in presses))
        await eventually(lambda: files() >= MAX_PENDING)
        last = new_press(Actor("Ann"), "http", "the last")
        assert not (await left.stop(last)).outcome.delivered
        await eventually(lambda: files() == MAX_PENDING)


async def test_a_robot_whose_directory_cannot_be_made_is_without_a_session_and_the_others_run(tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "left").write_text("in the way")
    async with running_bridge() as left, running_bridge() as right:
        ports = {"left": left.address[1], "right": right.address[1]}
        async with running_fleet(ports, state_dir=tmp_path) as rig:
            async with asyncio.timeout(PATIENCE):
                await rig.session("right").console.robot.reached.wait()
            tiles = await rig.tiles()
            assert (tiles["left"]["trouble"], tiles["right"]["link"]) == (FAILED, "up")


async def test_a_fault_while_a_session_ends_does_not_keep_the_console_from_ending(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    close = RecordingService.close

    async def fault(recordings: RecordingService) -> None:
        await close(recordings)
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(RecordingService, "close", fault)
    async with asyncio.timeout(3 * PATIENCE):
        async with running_fleet_rig("left", "right") as rig:
            pass
    assert all(each.dependencies is None for each in rig.fleet.sessions.values())
