"""Actions and status between a real console and real clients. The bridge's own log is the judge of what ended when."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import ActionCancelled, ActionRefused, Console, NotArmed
from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.maps import map_cells
from lockstep.server.recording.format.payload import own_record
from lockstep.server.recording.format.records import MapRecord, NavigationRecord
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_file import verify_file
from tests.client.held_up import ATTEMPTS, HELD_UP, act_on, arm_on
from tests.client.live.truth import until_logged
from tests.support.stack import Stack
from tests.waiting import PATIENCE

pytestmark = pytest.mark.asyncio(loop_scope="module")

AWAY = [0.4, 0.0, 0.0]
NEUTRAL = [0.0, 0.0, 0.0]


def _console(link: str, name: str = "Ada") -> Console:
    return Console(link, video=False, audio=False, name=name)


async def _go_away(console: Console) -> None:
    """So far from home that the way back takes a while."""
    await console.take_seat()
    while console.feedback is None or abs(console.feedback.joints[0]) < 0.4:
        await drive_on(console, AWAY)
    await console.rest()
    await arm_on(console)


async def _until(console: Console, condition: Any) -> None:
    async with asyncio.timeout(PATIENCE):
        async for _ in console.feedbacks():
            if condition():
                return


async def _has_begun(console: Console, task: "asyncio.Task[ActionUpdate]") -> bool:
    await _until(console, lambda: task.done() or any(each.state == "running" for each in console.actions))
    if not task.done():
        return True
    with pytest.raises(ActionCancelled) as cancelled:
        await task
    assert cancelled.value.reason in HELD_UP
    await arm_on(console)
    return False


@asynccontextmanager
async def _homing(console: Console) -> AsyncIterator[asyncio.Task[ActionUpdate]]:
    """The way home, begun; whatever becomes of it ends with the block."""
    for _ in range(ATTEMPTS):
        task = asyncio.create_task(console.act("home"))
        if await _has_begun(console, task):
            break
    try:
        yield task
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_home_brings_the_robot_home_and_everybody_sees_its_progress(stack: Stack) -> None:
    async with _console(stack.operator) as console, _console(stack.observer, "Grace") as observer:
        await _go_away(console)
        heard: list[ActionUpdate] = []
        final = await act_on(console, "home", heard.append)
        assert (final.state, final.text, final.by) == ("done", "at home", "Ada")
        shares = [each.progress for each in heard if each.id == final.id]
        assert shares == sorted(shares)
        assert len(shares) > 3
        assert console.feedback is not None
        assert abs(console.feedback.joints[0]) < 0.02
        await _until(observer, lambda: final in observer.actions)


async def test_an_action_that_moves_nothing_needs_the_seat_and_no_arming(stack: Stack) -> None:
    async with _console(stack.operator) as console:
        with pytest.raises(ActionRefused) as refused:
            await console.act("light")
        assert refused.value.reason == "no_seat"
        await console.take_seat()
        assert (await console.act("light", {"on": False})).text == "off"
        assert (await console.act("light")).text == "on"
        with pytest.raises(ActionRefused) as refused:
            await console.act("light", {"on": 3.0})
        assert refused.value.reason == "bad_parameter"
        with pytest.raises(ActionRefused) as refused:
            await console.act("fly")
        assert refused.value.reason == "unknown_action"


async def test_a_stick_that_is_moved_cancels_what_moves(stack: Stack) -> None:
    async with _console(stack.operator) as console:
        for _ in range(ATTEMPTS):
            await _go_away(console)
            async with _homing(console) as homing:
                with pytest.raises(ActionRefused) as refused:
                    await console.act("home")
                assert refused.value.reason == "busy"
                assert not homing.done(), "the second request takes nothing from the first"
                await drive_on(console, [0.0, 0.2, 0.0])
                try:
                    ended: str = (await homing).state  # a busy machine's robot was home before it was driven
                except ActionCancelled as cancelled:
                    ended = cancelled.reason
                if ended not in ("done", *HELD_UP):
                    break
        assert ended == "driving"


async def test_a_stop_from_an_observer_cancels_and_after_the_reset_arming_comes_first(stack: Stack) -> None:
    async with _console(stack.operator) as console, _console(stack.observer, "Grace") as observer:
        await _go_away(console)
        async with _homing(console) as homing:
            await observer.stop("a child")
            with pytest.raises(ActionCancelled) as cancelled:
                await homing
            assert cancelled.value.reason == "stopped"
            with pytest.raises(ActionRefused) as refused:
                await console.act("home")
            assert refused.value.reason == "stopped"
            await asyncio.sleep(1.0)  # the least age of a stop that a reset may name
            await console.reset()
            with pytest.raises(NotArmed):
                await console.act("home")
            await arm_on(console)
            assert (await act_on(console, "home")).state == "done"


async def test_a_seat_that_is_taken_cancels_what_moves(stack: Stack) -> None:
    here = await stack.from_here()
    async with _console(stack.operator) as console, _console(stack.supervisor, "Grace") as supervisor:
        await _go_away(console)
        async with _homing(console) as homing:
            await supervisor.take_seat()
            with pytest.raises(ActionCancelled):
                await homing
            ended = await until_logged(here, "action", lambda record: record["state"] == "cancelled")
            assert ended["reason"] in ("cancelled", "rested", "not_neutral")


async def test_a_client_that_ends_leaves_no_motion_behind(stack: Stack) -> None:
    here = await stack.from_here()
    async with _console(stack.operator) as console:
        await _go_away(console)
        async with _homing(console) as homing:
            homing.cancel()
            with pytest.raises(asyncio.CancelledError):
                await homing
            ended = await until_logged(here, "action", lambda record: record["state"] == "cancelled")
            assert ended["reason"] == "cancelled"


async def test_a_goal_on_the_map_is_driven_to_and_the_map_is_told(stack: Stack) -> None:
    async with _console(stack.operator) as console:
        await _until(console, lambda: console.navigation is not None and console.navigation.map != "")
        grid = await console.map()
        assert grid is not None
        assert console.navigation is not None
        assert grid.id == console.navigation.map
        assert len(map_cells(grid)) == grid.width * grid.height
        with pytest.raises(ActionRefused) as refused:
            await console.go_to(0.5, 0.0)
        assert refused.value.reason == "no_seat"
        await console.take_seat()
        for _ in range(ATTEMPTS):
            try:
                final = await console.go_to(0.5, 0.0)
                break
            except ActionCancelled as cancelled:
                if cancelled.reason not in HELD_UP:
                    raise
                await console.arm()
        assert final.state == "done"
        assert console.feedback is not None
        assert console.feedback.joints[:2] == pytest.approx([0.5, 0.0], abs=0.1)


async def test_the_status_is_told_with_units_and_age(stack: Stack) -> None:
    async with _console(stack.observer) as console:
        await _until(console, lambda: bool(console.status))
        battery = next(item for item in console.status if item.name == "battery")
        assert battery.kind == "battery"
        assert 0 < float(battery.value) <= 1
        assert battery.age < battery.old_after


async def test_a_recording_has_who_asked_what_and_how_it_went(stack: Stack, tmp_path: Path) -> None:
    token = stack.operator.partition("#token=")[2]
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx.AsyncClient(base_url=stack.console, headers=headers) as http, _console(stack.operator) as console:
        await _go_away(console)
        await _until(console, lambda: console.navigation is not None and console.navigation.map != "")
        grid = await console.map()
        assert grid is not None
        recording = (await http.post("/api/recordings", json={})).json()["recording"]
        final = await act_on(console, "home")
        assert (await http.post("/api/recordings/stop")).status_code == 200
        (tmp_path / "a.mcap").write_bytes((await http.get(f"/api/recordings/{recording}/file")).content)
    verdict = verify_file(tmp_path / "a.mcap")
    assert verdict.ok
    assert verdict.checks["actions"].looked > 2
    with RecordingReader(tmp_path / "a.mcap") as reader:
        (recorded,) = (own_record(MapRecord, each.data) for each in reader.records(topics={"/lockstep/map"}))
        places = [own_record(NavigationRecord, each.data) for each in reader.records(topics={"/lockstep/navigation"})]
        grids = list(reader.records(topics={"/map"}))
        found = [json.loads(each.data) for each in reader.records(topics={"/lockstep/action"})]
        items = [json.loads(each.data)["items"] for each in reader.records(topics={"/lockstep/status"})]
    assert [each["state"] for each in found][:2] == ["asked", "running"]
    assert (found[-1]["state"], found[-1]["id"], found[-1]["event"]) == ("done", final.id, final.event)
    assert "battery" in [item["name"] for item in items[0]]
    assert recorded.map == grid
    assert places[0].map == grid.id
    assert len(grids) == 1


async def test_over_http_only_what_moves_nothing_and_only_with_the_seat(stack: Stack) -> None:
    token = stack.operator.partition("#token=")[2]
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx.AsyncClient(base_url=stack.console, headers=headers) as http, _console(stack.operator) as console:
        refused = await http.post("/api/actions/light", json={"parameters": {"on": True}})
        assert (refused.status_code, refused.json()["error"]) == (403, "no_seat")
        await console.take_seat()
        taken = await http.post("/api/actions/light", json={"parameters": {"on": True}})
        assert taken.status_code == 200
        assert taken.json()["state"] in ("running", "done")
        refused = await http.post("/api/actions/home", json={})
        assert (refused.status_code, refused.json()["error"]) == (409, "not_renewable")
        assert (await http.post("/api/actions/fly", json={})).status_code == 404
        wrong = await http.post("/api/actions/light", json={"parameters": {"on": 3}})
        assert (wrong.json()["state"], wrong.json()["reason"]) == ("refused", "bad_parameter")
        known = (await http.get("/api/actions")).json()["actions"]
        assert known[-1] | {"age": 0.0} == wrong.json()  # told with its age since
        items = (await http.get("/api/status")).json()["status"]["items"]
        assert [item["name"] for item in items] == ["battery", "light"]
        metrics = (await http.get("/metrics")).text
        assert 'lockstep_actions_total{reason="bad_parameter",state="refused"}' in metrics
        assert 'lockstep_status_value{item="battery"}' in metrics
