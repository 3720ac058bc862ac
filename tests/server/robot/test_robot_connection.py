"""The robot link breaks and comes back."""

import asyncio
from typing import Any, cast

import pytest

from lockstep.protocol.console import Notice, RobotState
from lockstep.protocol.messages import LinkRole, Stop
from tests.server.rig import PATIENCE, eventually, running_bridge, running_console, stop_words


async def test_a_bridge_that_dies_shows_as_down_and_comes_back_by_itself() -> None:
    async with running_bridge() as bridge:
        port, first_epoch = bridge.address[1], bridge.epoch
        async with running_console(port) as rig:
            console = rig.dependencies.console
            async with asyncio.timeout(PATIENCE):
                await console.robot.reached.wait()
            async with rig.peer("observer") as peer:
                await peer.until(lambda each: isinstance(each, RobotState) and each.link == "up")
                await bridge.close()
                await peer.until(
                    lambda each: isinstance(each, RobotState) and each.link == "down" and bool(each.detail)
                )
                assert (await rig.http.get("/healthz")).json()["status"] == "degraded"
                assert rig.count("lockstep_robot_link_losses_total") == 1
                peer.send("stop", Stop(reason="dog"))
                await peer.until(lambda each: isinstance(each, Notice) and each.level == "error")
                assert (await rig.session())["epoch"] == first_epoch
                async with running_bridge(port) as second:
                    async with asyncio.timeout(PATIENCE):
                        await console.robot.reached.wait()
                        await peer.closed.wait()
                    assert (await rig.session())["epoch"] == second.epoch != first_epoch
                    assert (await rig.http.get("/healthz")).json()["status"] == "ok"
                    await eventually(lambda: console.clock.stop.stopped)
                    await console.peers.all_gone()
                    assert rig.count("lockstep_peers_ended_total", why="new epoch") == 1
                    async with rig.peer("observer") as again:
                        await again.feedback()


async def test_a_stop_while_no_link_lives_is_sent_first_when_one_does() -> None:
    async with running_bridge() as bridge:
        port = bridge.address[1]
    async with running_console(port) as rig:
        answer = await rig.http.post("/api/stop", headers=rig.token("observer"), json={"reason": "dog"})
        assert (answer.status_code, answer.json()["error"]) == (503, "link_down")
        async with running_bridge(port):
            console = rig.dependencies.console
            await eventually(lambda: console.clock.stop.stopped)
            assert stop_words(console.clock.stop) == ("observer", "dog")


async def test_a_restarted_bridge_is_stopped_again_if_the_last_one_was() -> None:
    async with running_bridge() as bridge:
        port = bridge.address[1]
        rig_context = running_console(port)
        rig = await rig_context.__aenter__()
        console = rig.dependencies.console
        async with asyncio.timeout(PATIENCE):
            await console.robot.reached.wait()
        await rig.http.post("/api/stop", headers=rig.token("observer"), json={"reason": "dog"})
        await eventually(lambda: console.clock.stop.stopped)
        first = bridge.epoch
    try:
        async with running_bridge(port):
            await eventually(lambda: console.clock.epoch != first and console.clock.stop.stopped)
            assert console.clock.stop.reason == "dog"
    finally:
        await rig_context.__aexit__(None, None, None)


async def test_a_second_console_waits_until_the_operator_link_is_free() -> None:
    async with running_bridge() as bridge, running_console(bridge.address[1]) as first:
        async with asyncio.timeout(PATIENCE):
            await first.dependencies.console.robot.reached.wait()
        async with running_console(bridge.address[1]) as second:
            console = second.dependencies.console
            await eventually(lambda: "taken" in console.robot.detail)
            answer = await second.http.post("/api/stop", headers=second.token("observer"))
            assert answer.status_code == 200, "a stop passes on the media link"
            await eventually(lambda: first.dependencies.console.clock.stop.stopped)


@pytest.mark.parametrize(
    ("failing", "other", "handler"),
    [
        ("operator", "media", "feedback_received"),
        ("media", "operator", "feed"),
    ],
)
async def test_a_fault_at_what_comes_by_one_link_ends_that_one_by_name_and_leaves_the_other(
    failing: LinkRole, other: LinkRole, handler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_bridge() as bridge, running_console(bridge.address[1]) as rig:
        console = rig.dependencies.console
        keepers: Any = cast(Any, console.robot)._keepers
        await eventually(lambda: all(keeper._link is not None for keeper in keepers.values()))
        before = keepers[failing]._link, keepers[other]._link
        host = rig.dependencies.media if failing == "media" else console
        received, heard = getattr(host, handler), asyncio.Event()

        def fail_once(*message: Any) -> None:
            if keepers[failing]._link is before[0]:
                raise ValueError("planted")
            received(*message)
            heard.set()

        monkeypatch.setattr(host, handler, fail_once)
        async with asyncio.timeout(PATIENCE):
            await heard.wait()
        assert keepers[other]._link is before[1], "it lives"
        assert rig.count("lockstep_internal_errors_total", where=f"robot link {failing}") == 1
        assert rig.count("lockstep_robot_link_losses_total") == (failing == "operator")
        await eventually(lambda: console.robot.up)
