"""A few short episodes through everything real: MuJoCo, bridge, console, people and a policy, dataset, pixels."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from lockstep.bench.episodes.cli import app
from lockstep.bench.episodes.faults.fault_run import DISK_FAULTS, FAULTS, FaultName
from lockstep.bench.episodes.pixels import look
from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.robot_bridge.robots.so101.driver import MODEL_FOLDER
from tests.server.recording.graders import PASSED, doctor_findings, graded_defects

FEW = ["--times", "3", "--discard", "1", "--redo", "1", "--no-pictures"]


@pytest.fixture
def arm(monkeypatch: pytest.MonkeyPatch) -> None:
    if not (MODEL_FOLDER / ".installed").is_file():
        pytest.skip("the model of the SO-101 is not here; `make test` fetches it")
    monkeypatch.setenv(FOLDER_VARIABLE, str(MODEL_FOLDER))


@pytest.mark.timeout(600)
@pytest.mark.usefixtures("arm")
def test_a_dataset_of_people_and_a_policy_has_the_kept_episodes_alone_and_each_picture_shows_its_rows_event(
    tmp_path: Path,
) -> None:
    done = CliRunner().invoke(app, [*FEW, "--keep", str(tmp_path), "--json", "-"])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(done.stdout)["runs"]
    assert (figures["episodes"], figures["kept"], figures["discarded"], figures["redone"]) == (3, 2, 1, 1)
    assert [each["drivers"] for each in figures["runs"] if each["kept"]] == [["Grace"], ["net", "Grace", "net"]]
    assert (figures["with_policy"], figures["corrections"]) == (1, 1)
    dataset = figures["dataset"]
    assert len(dataset["rows"]) == 2
    assert min(dataset["rows"]) > 5
    assert dataset["pictures"] == 2 * sum(dataset["rows"])
    assert dataset["policy"] > 10
    assert dataset["interventions"] > 5
    assert (dataset["unreadable"], dataset["outside"], dataset["mislabelled"]) == (0, 0, 0)
    root = tmp_path / "dataset"
    assert look(root).ok
    passed, more = doctor_findings(root)
    assert (passed & PASSED, more) == (PASSED, [])
    assert {name: defective for name, (_, defective) in graded_defects(root).items() if defective} == {}
    verdict = verify_dataset(root, pixels=True)
    assert verdict.ok
    assert verdict.checks["shown"].looked == dataset["pictures"]
    _shift(root, "lockstep.stamp", lambda stamps: [stamp - 1 for stamp in stamps])
    verdict = verify_dataset(root, pixels=True)
    assert verdict.checks["aligned"].count < dataset["pictures"] / 2, "of most, the stamps alone are as they should be"
    assert verdict.checks["shown"].count == dataset["pictures"]
    assert not look(root).ok
    _shift(root, "lockstep.stamp", lambda stamps: [stamp + 1 for stamp in stamps])
    assert look(root).ok
    _shift(root, "lockstep.event", lambda event: event + 10)
    seen = look(root)
    assert not seen.ok
    assert seen.outside == seen.pictures


def _shift(root: Path, column: str, how: Callable[[Any], Any]) -> None:
    """Say something else of each row."""
    [path] = (root / "data").rglob("*.parquet")
    table = pq.read_table(path)
    place = table.schema.get_field_index(column)
    values = pa.array([how(value) for value in table.column(place).to_pylist()], table.schema.field(place).type)
    pq.write_table(table.set_column(place, table.schema.field(place), values), path)


@pytest.mark.timeout(600)
@pytest.mark.usefixtures("arm")
def test_a_console_that_is_killed_while_it_keeps_an_episode_leaves_a_dataset_of_whole_episodes() -> None:
    done = CliRunner().invoke(app, ["--fault", "kill-keeping", "--json", "-"])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(done.stdout)["runs"]
    [fault] = figures["faults"]
    assert fault["ok"]
    assert 1 <= fault["kept"] <= fault["in_dataset"] <= 2


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.usefixtures("arm")
@pytest.mark.parametrize("fault", [each for each in FAULTS if each != "kill-keeping"])
def test_whatever_fails_in_whatever_phase_leaves_a_dataset_of_whole_episodes(fault: FaultName) -> None:
    if fault in DISK_FAULTS and os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    done = CliRunner().invoke(app, ["--fault", fault, "--json", "-"])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(done.stdout)["runs"]
    assert [(each["fault"], each["wrong"]) for each in figures["faults"]] == [(fault, [])]


@pytest.mark.timeout(600)
@pytest.mark.usefixtures("arm")
def test_faults_among_the_episodes_leave_a_dataset_of_the_kept_ones() -> None:
    faults = ["--fault", "kill-open", "--fault", "kill-robot"]
    few = ["--times", "2", "--discard", "0", "--redo", "1", "--no-pictures"]
    done = CliRunner().invoke(app, [*few, "--among-episodes", *faults, "--json", "-"])
    assert done.exit_code == 0, done.output
    [figures] = json.loads(done.stdout)["runs"]
    assert [(each["fault"], each["ok"]) for each in figures["faults"]] == [("kill-open", True), ("kill-robot", True)]
    assert "lost" in " ".join(figures["faults"][1]["said"])
    assert (figures["kept"], figures["in_dataset"], len(figures["appended"]["rows"])) == (2, 2, 2)
    assert min(each["rows"] for each in figures["runs"]) > 5


def test_more_discarded_and_redone_episodes_than_there_are_is_an_error() -> None:
    done = CliRunner().invoke(app, ["--times", "3", "--discard", "2", "--redo", "2"])
    assert done.exit_code == 2
    assert "more episodes" in done.output
