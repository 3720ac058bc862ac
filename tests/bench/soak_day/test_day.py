import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lockstep.bench.soak_day.cli import LEGS
from lockstep.bench.soak_day.day import BROKEN, DAY, HOURS, Leg, drift, plan, summary
from lockstep.server.cli.main import app


def leg(**fields: Any) -> Leg:
    usual: dict[str, Any] = {
        "began": "2026-01-02T03:04:05+00:00",
        "seconds": 1200.0,
        "seed": 1,
        "done": {},
        "pictures": {"chromium": 600, "firefox": 400},
        "relayed": {"0": 500, "1": 500},
        "broken": dict.fromkeys(BROKEN, 0),
        "executed": 10,
        "memory_growth": 0.01,
        "feedback_drift": 1.0,
        "picture_drift": 1.1,
    }
    return Leg(**{**usual, **fields})


@pytest.mark.parametrize("minutes", [5.0, 20.0])
def test_runs_of_any_length_add_up_to_a_day(minutes: float) -> None:
    done = dict.fromkeys(DAY, 0)
    for seed in range(round(HOURS * 60 / minutes)):
        for action in plan(minutes, seed):
            done[action.kind] += 1
    assert {kind: count for kind, count in done.items() if kind != "pictures" and count < DAY[kind]} == {}


def test_a_plan_is_in_order_within_its_run_and_the_same_for_the_same_seed() -> None:
    actions = plan(20.0, 7)
    assert actions == plan(20.0, 7) != plan(20.0, 8)
    assert actions == sorted(actions)
    assert actions[0].at > 0.0
    assert all(each.at + each.seconds < 20.0 * 60 for each in actions)


def test_recordings_begin_and_end_in_turns() -> None:
    kinds = [each.kind for each in plan(20.0, 3) if each.kind in ("begin_recording", "end_recording")]
    assert kinds == ["begin_recording", "end_recording"] * (len(kinds) // 2)


def test_a_run_however_short_has_every_kind() -> None:
    assert {each.kind for each in plan(0.5, 1)} == DAY.keys() - {"pictures"}


@pytest.mark.parametrize(
    ("samples", "found"), [([], None), ([1.0] * 59, None), ([2.0] * 20 + [9.0] * 20 + [3.0] * 20, 1.5)]
)
def test_drift_compares_the_last_third_with_the_first(samples: list[float], found: float | None) -> None:
    assert drift(samples) == found


def test_a_day_is_complete_when_the_runs_together_have_done_all_of_it() -> None:
    half = {kind: count // 2 for kind, count in DAY.items() if kind != "pictures"}
    first, second = (leg(done=half, pictures={"chromium": 300_000, "firefox": 200_000}) for _ in range(2))
    assert summary([first])["verdicts"]["day_complete"] is False
    found = summary([first, second])
    assert found["verdicts"] == dict.fromkeys(("nothing_broken", "memory_flat", "no_drift", "day_complete"), True)
    assert found["day"]["pictures"] == "1000000 of 1000000"
    assert found["pictures_by_page"] == {"chromium": 600_000, "firefox": 400_000}
    assert found["pictures_by_relay"] == {"0": 1000, "1": 1000}


@pytest.mark.parametrize("name", BROKEN)
def test_what_was_broken_once_stays_broken(name: str) -> None:
    found = summary([leg(), leg(broken={**dict.fromkeys(BROKEN, 0), name: 1}), leg()])
    assert found["verdicts"]["nothing_broken"] is False
    assert found[name] == 1


def test_memory_that_grows_or_a_delay_that_drifts_in_one_run_is_told() -> None:
    found = summary([leg(), leg(memory_growth=0.2, feedback_drift=2.0)])["verdicts"]
    assert (found["memory_flat"], found["no_drift"], found["nothing_broken"]) == (False, False, True)
    short = summary([leg(memory_growth=None, feedback_drift=None, picture_drift=None)])["verdicts"]
    assert (short["memory_flat"], short["no_drift"]) == (False, False), "what was not measured is not claimed"


def test_the_command_reports_what_the_file_has_without_another_run(tmp_path: Path) -> None:
    file = tmp_path / "day.json"
    file.write_bytes(json.dumps([]).encode())
    done = CliRunner().invoke(app, ["soak-day", str(file), "--minutes", "0"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["runs"] == 0
    assert LEGS.decode(file.read_bytes()) == []


def test_a_file_of_something_else_is_refused_and_kept(tmp_path: Path) -> None:
    file = tmp_path / "day.json"
    file.write_text('{"port": 1}')
    done = CliRunner().invoke(app, ["soak-day", str(file), "--minutes", "0"])
    assert done.exit_code == 2
    assert "is no file of this command" in done.output
    assert file.read_text() == '{"port": 1}'
