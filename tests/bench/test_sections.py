"""Short runs of what needs no browser: that they measure at all, and not how much."""

from pathlib import Path

import pytest

from lockstep.bench import sections
from lockstep.bench.cli import SECTIONS, measure
from lockstep.bench.context import Context
from lockstep.bench.harness.driving import console_trips, link_trips
from lockstep.bench.harness.event_log import robot_times
from lockstep.bench.harness.stack import running_bridge, running_stack
from lockstep.bench.sections.costs import datagrams, episodes_cost, scene
from lockstep.bench.sections.driving import command_to_feedback, goals
from lockstep.client import Console
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.e2e.so101 import SO101, needs_so101


async def test_every_trip_through_a_console_is_one_event_that_the_robot_executed() -> None:
    async with running_stack("planar") as stack:
        async with Console(stack.operator, video=False, audio=False) as console:
            await console.take_seat()
            trips = await console_trips(console, 20)
        robot = robot_times(stack.bridge.event_log)
    events = [trip.event for trip in trips]
    assert len(events) == 20
    assert events == sorted(set(events))  # a busy machine may need a neutral command between two, which is no trip
    assert all(0 < robot[trip.event] < trip.seconds for trip in trips)


async def test_every_trip_over_the_bare_link_is_one_event_that_the_robot_executed() -> None:
    async with running_bridge("planar") as bridge:
        async with RobotLink("127.0.0.1", bridge.port, "operator") as link:
            assert link.hello.description is not None
            trips = await link_trips(link, link.hello.description, 20)
        robot = robot_times(bridge.event_log)
    assert all(0 < robot[trip.event] < trip.seconds for trip in trips)


async def test_command_to_feedback_reports_each_figure_with_its_baseline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_to_feedback, "QUICK_EVENTS", 20)
    results = await command_to_feedback.run(Context(quick=True, robots=["planar"], say=lambda _: None))
    assert [result.target for result in results] == [8.0, 20.0, 1.0, None]
    assert all(result.value and result.baseline and result.samples == 20 for result in results)
    total, _, own, _ = results
    assert own.value is not None
    assert total.value is not None
    assert own.value < total.value


@needs_so101
async def test_the_cost_of_episodes_is_told_beside_driving_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in SO101.items():
        monkeypatch.setenv(name, value)
    for name in ("SECONDS", "WARM"):
        monkeypatch.setattr(episodes_cost, name, 1.0)
    results = await episodes_cost.run(Context(quick=True, robots=[], say=lambda _: None))
    assert [result.name for result in results] == [
        f"so101: command → feedback, {kind}, {name}"
        for kind in ("recording", "recording and appending")
        for name in ("median", "p95", "p99")
    ]
    assert all(result.value and result.baseline and result.samples for result in results)


@needs_so101
async def test_the_goals_section_compares_goals_with_neutral_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in SO101.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(goals, "QUICK_TURNS", 1)
    monkeypatch.setattr(goals, "EVENTS", 5)
    results = await goals.run(Context(quick=True, robots=[], say=lambda _: None))
    added, ticks = results[:4], results[4:]
    assert [result.name for result in added] == [
        f"so101: {kind}, {name}" for kind in ("a joint's goals", "goals of the tool") for name in ("median", "p99")
    ]
    assert all(result.value and result.baseline and result.samples == 5 for result in added)
    assert all(result.target == pytest.approx(1.1 * (result.baseline or 0.0)) for result in added[::2])
    assert {result.name.split(":")[0] for result in ticks} == {"so101", "mobile-manipulator-goals"}
    assert all(result.value and result.samples == 3000 for result in ticks)


async def test_the_goals_section_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SO101_MODEL_FOLDER", str(tmp_path))
    (missing,) = await goals.run(Context(quick=True, robots=[], say=lambda _: None))
    assert missing.value is None
    assert "lockstep robot fetch so101" in missing.conditions


async def test_the_datagrams_section_sends_pictures_in_one_call_and_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(datagrams, "QUICK_TURNS", 2)
    results = await datagrams.run(Context(quick=True, robots=[], say=lambda _: None))
    assert all(result.value and result.baseline and result.samples == 768 for result in results)
    assert len(results) == 3


async def test_the_scene_section_drives_with_and_without_viewers_who_get_the_scene(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scene, "QUICK_EVENTS", 10)
    monkeypatch.setattr(scene, "SETTLE", 0.0)
    with_viewers, _, ratio = await scene.run(Context(quick=True, robots=["planar"], say=lambda _: None))
    assert with_viewers.value is not None
    assert with_viewers.baseline is not None
    assert ratio.value == pytest.approx(with_viewers.value / with_viewers.baseline)
    assert ratio.target == 1.1
    assert "10 events with 3 viewers" in ratio.conditions


async def test_a_section_that_fails_is_named_and_the_others_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(context: Context) -> list[object]:
        raise RuntimeError("no such luck")

    async def nothing() -> list[str]:
        return []

    monkeypatch.setattr("lockstep.bench.cli.available_robots", nothing)
    monkeypatch.setattr("lockstep.bench.sections.driving.lossy.run", fail)
    measured = await measure(["lossy", "command_to_feedback"], quick=True)
    assert measured.failed == {"lossy": "RuntimeError: no such luck"}
    assert measured.busy_percent.keys() == {"lossy", "command_to_feedback"}


def test_every_section_is_listed() -> None:
    files = {path.stem: path.parent.name for path in Path(sections.__file__).parent.glob("*/*.py")}
    del files["__init__"]
    assert files == SECTIONS
