"""What `python -m lockstep.bench.quality` counts, and the repair of losses in simulated time."""

import asyncio
import json

import pytest
from typer.testing import CliRunner

from lockstep.bench.harness.stack import running_stack
from lockstep.bench.quality.cli import app
from lockstep.bench.quality.freezes import freezes
from lockstep.bench.quality.repair import simulate
from lockstep.bench.quality.stage import driving
from lockstep.bench.quality.summary import summarise
from lockstep.emulator import load_profile


def test_an_interval_much_longer_than_usual_is_a_freeze() -> None:
    times = [i / 30 for i in range(60)] + [2.5 + i / 30 for i in range(30)]
    assert freezes(times) == [pytest.approx(2.5 - 59 / 30)]
    assert freezes([i / 5 for i in range(50)]) == []
    assert freezes([]) == []


@pytest.mark.parametrize(("loss", "most"), [(0.01, 2), (0.03, 6), (0.05, 12), (0.10, 30)])
def test_lost_packets_are_repaired_before_a_person_sees_much_of_it(loss: float, most: float) -> None:
    figures = simulate(loss=loss, round_trip=0.06, seconds=60, seed=3).figures(60)
    assert figures["pictures_shown_percent"] > 99
    assert figures["freezes_per_minute"] <= most
    assert figures["longest_freeze_s"] < 0.7
    assert figures["keyframes_per_minute"] < 8  # six come by themselves


def test_over_a_satellite_pictures_are_late_but_not_given_up() -> None:
    figures = simulate(loss=0.05, round_trip=0.6, seconds=60, seed=3).figures(60)
    assert figures["pictures_shown_percent"] > 85
    assert figures["keyframe_requests"] < 10


def test_without_retransmission_keyframes_are_no_storm() -> None:
    found = simulate(loss=0.1, round_trip=0.06, seconds=60, seed=3, retransmit=False)
    assert found.repeated == 0
    assert found.keyframes <= 62


def test_a_seed_repeats_a_simulation() -> None:
    first, again = (simulate(loss=0.05, round_trip=0.1, seconds=20, seed=5, burst=4) for _ in range(2))
    assert first == again


def test_the_command_writes_json() -> None:
    result = CliRunner().invoke(app, ["repair", "5", "--seconds", "10", "--json", "-"])
    assert result.exit_code == 0
    assert set(json.loads(result.stdout)["5 %"]) == {"keyframes only", "repaired"}


async def test_a_drive_ends_with_its_console_and_says_when() -> None:
    async with running_stack("planar", LOCKSTEP_MEDIA__QUALITY="true") as stack:

        async def kill_once_it_drives() -> None:
            # Each command waits for the answer to the last, so that the third shows two answers at the operator's.
            while stack.bridge.event_log.read_bytes().count(b'"executed"') < 3:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
            await stack.console.kill()

        killing = asyncio.create_task(kill_once_it_drives())
        drive = await driving(stack, load_profile("micro-lan"), seconds=40, tolerance=4, seed=1)
        await killing
    assert drive.lost_at is not None
    assert drive.events > 0
    assert summarise(drive, 40)["lost_after_seconds"] == round(drive.lost_at, 1)
