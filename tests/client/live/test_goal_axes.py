"""Goal axes from a client through a real console, over real WebRTC and TCP, to a small arm of the tests."""

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from pathlib import Path

import httpx
import pytest
import pytest_asyncio

from lockstep.client import (
    Clutch,
    CommandError,
    CommandRefused,
    Console,
    GoalNotReached,
    NotArmed,
)
from lockstep.server.recording.verify.verify_file import verify_file
from tests.client.live.goal_robot import ARM, SAG, GoalRobot, running_goal_robot
from tests.support.stack import Stack, running_console
from tests.waiting import PATIENCE

pytestmark = pytest.mark.asyncio(loop_scope="module")

Loss = Callable[[Console, Stack], Awaitable[None]]
NEUTRAL = [0.0, None, None]
J1, J2 = 1, 2


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def arm() -> AsyncIterator[GoalRobot]:
    async with running_goal_robot() as robot:
        yield robot


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def served(arm: GoalRobot, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stack]:
    directory: Path = tmp_path_factory.mktemp("console")
    robot = f"tcp://127.0.0.1:{arm.address[1]}"
    async with running_console(directory, robot, directory / "events.jsonl") as stack:
        yield stack


@pytest_asyncio.fixture(loop_scope="module")
async def console(served: Stack, arm: GoalRobot) -> AsyncIterator[Console]:
    """In the seat and armed, with the arm where every test begins."""
    arm.blocked.clear()
    arm.applied = [0.0, 0.5, 3.0]
    async with Console(served.operator, video=False, audio=False, name="Ada") as console:
        await console.take_seat()
        yield console


async def _until(console: Console, condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        async for _ in console.feedbacks():
            if condition():
                return


async def _reset(console: Console) -> None:
    """Reset as soon as the robot takes it, a second after the stop."""
    while True:
        try:
            await console.reset()
            return
        except CommandRefused as refused:
            if refused.reason != "too_soon":
                raise


def _goal(console: Console, index: int) -> float:
    assert console.feedback is not None
    goal = console.feedback.goals[index]
    assert goal is not None
    return goal


async def test_a_goal_is_driven_to_and_left_to_stay(console: Console, arm: GoalRobot) -> None:
    while (await console.drive({"j1": 0.7})).goals[J1] != 0.7:
        pass
    before = len(arm.executed_values)
    await _until(console, lambda: arm.executed_values[before:].count(NEUTRAL) >= 2)  # sent when nobody drives
    assert _goal(console, J1) == 0.7
    assert console.feedback is not None
    assert console.feedback.axes[J1] == pytest.approx(0.7 - SAG)
    await console.rest()
    assert _goal(console, J1) == 0.7


async def test_the_speed_that_was_asked_for_reaches_the_robot(console: Console, arm: GoalRobot) -> None:
    await console.drive({"j1": 0.6}, speed=0.125)
    assert arm.speed == 0.125
    await console.drive({"j1": 0.6})
    assert arm.speed == 1.0


async def test_a_goal_out_of_reach_is_refused_as_a_jump_and_moves_nothing(console: Console, arm: GoalRobot) -> None:
    with pytest.raises(CommandRefused) as refused:
        await console.drive({"j1": 1.5})
    assert refused.value.reason == "jump"
    assert arm.goals[J1] == 0.5
    await console.arm()
    await console.drive({"j1": 0.6})


@pytest.mark.parametrize(
    "values", [{"base": None}, [None, None, None], {"j1": math.nan}, {"j1": math.inf}, [0.0, None], {"j3": 0.0}]
)
async def test_values_that_no_robot_accepts_are_not_sent(console: Console, arm: GoalRobot, values: object) -> None:
    before = len(arm.executed_values)
    with pytest.raises(CommandError):
        await console.drive(values)  # type: ignore[arg-type]
    with pytest.raises(CommandError):
        await console.drive({"j1": 0.6}, speed=1.5)
    assert len(arm.executed_values) == before


async def test_engaging_a_clutch_moves_nothing_and_then_the_arm_follows_the_device(
    console: Console, arm: GoalRobot
) -> None:
    clutch = console.clutch({"j1": 1.0, "j2": -1.0})
    device = [-5.0, 40.0]
    assert clutch.engage(device)
    await console.drive(clutch.values(device))
    assert arm.executed_values[-1] == [0.0, 0.5, 3.0]
    for _ in range(20):
        device = [device[0] + 0.01, device[1] - 0.02]
        await console.drive(clutch.values(device))
    while (answer := await console.drive(clutch.values(device))).goals[J2] != pytest.approx(3.4 - 2 * math.pi):
        pass
    assert answer.goals[J1] == pytest.approx(0.7)
    assert clutch.clipped == ()
    await console.rest()
    assert not clutch.engaged


async def test_a_device_that_is_swung_too_far_never_makes_the_arm_refuse(console: Console, arm: GoalRobot) -> None:
    clutch = console.clutch({"j1": 1.0})
    assert clutch.engage([0.0])
    answer = await console.drive(clutch.values([1.2]))
    assert list(clutch.clipped) == ["j1"]
    while answer.goals[J1] != pytest.approx(1.7):
        answer = await console.drive(clutch.values([1.2]))
    assert not clutch.clipped


async def _hand_over_and_back(console: Console, served: Stack) -> None:
    async with Console(served.supervisor, video=False, audio=False, name="Boss") as boss:
        await boss.take_seat()
        await boss.move_to({"j1": 1.0})
        boss.release_seat()
        await _until(console, lambda: not console.seat.holder)
    await console.take_seat()


async def _stop_and_reset(console: Console, served: Stack) -> None:
    await console.stop()
    await _reset(console)
    await console.arm()


async def _drive_nothing(console: Console, served: Stack) -> None:
    answer = console.feedback
    assert answer is not None
    await _until(console, lambda: console.feedback is not None and console.feedback.event > answer.event + 1)


@pytest.mark.parametrize("loss", [_hand_over_and_back, _stop_and_reset, _drive_nothing])
async def test_after_a_loss_the_clutch_has_to_be_engaged_anew_and_that_moves_nothing(
    console: Console, served: Stack, arm: GoalRobot, loss: Loss
) -> None:
    clutch = console.clutch({"j1": 1.0})
    assert clutch.engage([0.0])
    await console.drive(clutch.values([0.1]))
    await loss(console, served)
    assert not clutch.engaged
    assert clutch.values([0.2]) == {"j1": None}
    before = len(arm.executed_values)
    await console.drive(clutch.values([0.2]))
    assert clutch.engage([0.3])
    stays = _goal(console, J1)
    await console.drive(clutch.values([0.3]))
    moving = [values for values in arm.executed_values[before:] if values != NEUTRAL]
    assert moving == [[0.0, stays, None]]


async def test_a_robot_that_is_gone_releases_the_clutch(console: Console, arm: GoalRobot) -> None:
    clutch = console.clutch({"j1": 1.0})
    assert clutch.engage([0.0])
    await console.drive(clutch.values([0.0]))
    for link in list(arm.links):
        link.writer.close()
    await _until_released(clutch, console)
    await _until(console, lambda: any(link.role == "operator" for link in arm.links))
    await console.arm()
    assert not clutch.engaged


async def _until_released(clutch: Clutch, console: Console) -> None:
    async with asyncio.timeout(PATIENCE):
        while clutch.engaged:
            with suppress(CommandRefused):
                await console.drive(clutch.values([0.0]))


async def test_move_to_goes_far_beyond_reach_and_returns_when_it_is_there(console: Console, arm: GoalRobot) -> None:
    before = len(arm.executed_values)
    answer = await console.move_to({"j1": -1.5, "j2": -3.0}, tolerance=0.02)
    assert answer.axes[J1] == pytest.approx(-1.5, abs=0.02)
    assert answer.axes[J2] == pytest.approx(-3.0, abs=0.02)
    assert all(values[0] == 0.0 for values in arm.executed_values[before:])
    turned = [values[J2] for values in arm.executed_values[before:] if values[J2] is not None]
    assert all(abs(value) > 2.9 for value in turned if value is not None)  # across the border, the shorter way
    assert (await console.move_to({"j1": -1.5})).event > answer.event  # it is there already


async def test_move_to_something_that_is_blocked_fails_by_name_and_the_arm_rests(
    console: Console, arm: GoalRobot
) -> None:
    arm.blocked[J1] = 0.49
    rests = arm.rests
    with pytest.raises(GoalNotReached) as failed:
        await console.move_to({"j1": 1.5})
    assert (failed.value.axis, failed.value.goal) == ("j1", 1.5)
    assert failed.value.measured == pytest.approx(0.49)
    assert "comes no nearer" in str(failed.value)
    await _until(console, lambda: arm.rests > rests)
    assert arm.applied[J1] <= 0.49 + ARM.axes[J1].reach


async def test_move_to_that_is_cancelled_rests(console: Console, arm: GoalRobot) -> None:
    rests = arm.rests
    moving = asyncio.create_task(console.move_to({"j1": 2.0}, speed=0.1))
    await _until(console, lambda: _goal(console, J1) > 0.55)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    await _until(console, lambda: arm.rests > rests)
    await console.rest()
    assert _goal(console, J1) < 1.0


@pytest.mark.parametrize("goals", [{"j1": 2.1}, {"j1": math.nan}, {"base": 0.1}, {"j3": 0.0}, {}])
async def test_move_to_takes_goal_axes_within_their_range_only(
    console: Console, arm: GoalRobot, goals: dict[str, float]
) -> None:
    with pytest.raises(CommandError):
        await console.move_to(goals)


async def test_a_stopped_robot_is_not_moved_to(console: Console) -> None:
    await console.stop()
    with pytest.raises(CommandRefused) as refused:
        await console.move_to({"j1": 1.0})
    assert refused.value.reason == "stopped"
    await _reset(console)
    with pytest.raises(NotArmed):
        await console.move_to({"j1": 1.0})


async def test_a_recorded_drive_is_verified_with_its_goals(console: Console, served: Stack, tmp_path: Path) -> None:
    token = served.operator.partition("#token=")[2].partition("&")[0]
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx.AsyncClient(base_url=served.console, headers=headers, trust_env=False) as http:
        recording = (await http.post("/api/recordings", json={})).json()["recording"]
        await console.move_to({"j1": 1.5})
        await console.move_to({"j1": -0.5, "j2": 2.0}, speed=0.5)
        assert (await http.post("/api/recordings/stop")).status_code == 200
        (tmp_path / "a.mcap").write_bytes((await http.get(f"/api/recordings/{recording}/file")).content)
    verdict = verify_file(tmp_path / "a.mcap")
    assert verdict.ok, {name: check.violations for name, check in verdict.checks.items() if not check.ok}
    assert verdict.checks["goals"].looked > 40
