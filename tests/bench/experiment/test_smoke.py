"""Real robots, consoles, networks and clients, for a few seconds."""

import asyncio
import json

import pytest
from typer.testing import CliRunner

from lockstep.bench.experiment.choices import PROFILES
from lockstep.bench.experiment.endurance.growth import MEDIA
from lockstep.bench.experiment.headless import headless_client
from lockstep.bench.experiment.judge.measures import beyond
from lockstep.bench.experiment.judge.outage import OUTAGE_PROFILE, run_outages
from lockstep.bench.experiment.operator_script import OperatorScript
from lockstep.bench.experiment.stage import running_stage
from lockstep.emulator.impairment.profile import load_profile
from lockstep.emulator.network import Network
from lockstep.server.cli.main import app
from tests.bench.experiment.made_up import choices

SECONDS = 3.0


async def test_behind_every_network_nothing_beyond_the_tolerance_is_rendered() -> None:
    """One operator beside the robot; behind each network a viewer, all at the same time."""
    driven, said = asyncio.Event(), choices(tolerance=3)
    ready: list[str] = []
    all_ready = asyncio.Event()
    async with running_stage("planar", load_profile("perfect"), MEDIA, 1) as stage:

        async def look(name: str) -> None:
            network = Network(name, console_url=stage.near_link.partition("/#")[0], seed=1)
            async with (
                network,
                headless_client(network.link(stage.near_link), said, name, "event", "feedback", drives=False) as viewer,
            ):
                await viewer.until_picture()
                ready.append(name)
                if len(ready) == len(PROFILES):
                    all_ready.set()
                async with viewer.observed():
                    await driven.wait()
                record = viewer.record
            assert all(record.rendered.values()), name
            for stream, entries in record.rendered.items():
                assert beyond(entries, said.tolerance) == 0, (name, stream)
            assert [stream["violations"] for stream in record.statistics["streams"]] == [0, 0]
            assert record.drawn_wrong == 0

        async with asyncio.timeout(100), asyncio.TaskGroup() as group:
            for name in PROFILES:
                group.create_task(look(name))
            near = headless_client(stage.link, said, "operator", "event", "media", drives=True)
            async with near as operator:
                await operator.take_seat()
                await all_ready.wait()
                await operator.drive(OperatorScript(operator.description.axes, 1), SECONDS)
                await operator.rest()
            driven.set()


def test_the_command_runs_an_experiment_and_prints_its_figures() -> None:
    done = CliRunner().invoke(app, ["experiment", "micro-lan", "--mode", "off", "--seconds", "2", "--json", "-"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert (result["profile"], result["mode"], result["tolerance"]) == ("micro-lan", "off", 4)
    assert set(result["clients"]) == {"operator", "watcher-age", "watcher-event"}
    for client in result["clients"].values():
        picture = client["streams"]["overview"]
        assert picture["received"] == picture["rendered"] + picture["discarded"] > 0
    assert result["verdicts"]["no_violation"]


@pytest.mark.parametrize("robot", ["mobile-manipulator", "micromanipulator"])
def test_the_robots_of_the_thesis_kind_draw_the_event_that_is_looked_for_in_their_pictures(robot: str) -> None:
    command = ["experiment", "micro-lan", "--robot", robot, "--seconds", "3", "--no-watchers", "--json", "-"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["robot"] == robot
    assert (result["verdicts"]["no_violation"], result["verdicts"]["pixels_agree"]) == (True, True)


async def test_after_an_outage_nothing_that_was_queued_is_executed_and_the_operator_drives_again() -> None:
    found = await run_outages(choices(seconds=2.5), OUTAGE_PROFILE, lambda _: None, ways=[True])
    [outage] = found["outages"]
    assert outage["nothing_queued_executed"], outage
    assert outage["rest_ms"] is not None
    assert outage["control_ms"] is not None
