"""What an endurance run counts, and real ones: a few seconds here, a minute each with `make test-long`."""

import json

import pytest
from typer.testing import CliRunner

from lockstep.bench.experiment.endurance.endurance import Endurance, Lost, cut_for_long
from lockstep.emulator.impairment.outages import PlannedOutage
from lockstep.server.cli.main import app


def _streams(rendered: int, violations: int = 0) -> dict[str, dict[str, object]]:
    return {
        "overview": {"kind": "video", "rendered": rendered, "violations": violations},
        "microphone": {"kind": "audio", "rendered": 2 * rendered, "violations": 0},
    }


def _look(endurance: Endurance, at: float, rendered: int, *, live: bool = True, mine: bool = True) -> None:
    endurance.look(at, live=live, mine=mine, driving=live and mine, streams=_streams(rendered))


def test_a_run_without_trouble_has_one_connection_and_all_verdicts() -> None:
    endurance = Endurance()
    for second in range(11):
        _look(endurance, float(second), 30 * second)
        assert endurance.ended(float(second), {}) == []
    assert endurance.fields() == {
        "connections": 1,
        "lost": [],
        "reconnections": 0,
        "longest_silence_seconds": 0.0,
        "seat_losses": 0,
        "refused": {},
        "driven_seconds": 10,
        "pictures": 300,
        "sound_segments": 600,
        "violations": 0,
        "verdicts": {"no_connection_lost": True, "nothing_beyond_tolerance": True, "pictures_came": True},
    }


def test_a_lost_connection_breaks_the_verdict_and_pictures_of_all_connections_count() -> None:
    endurance = Endurance()
    _look(endurance, 0.0, 0)
    _look(endurance, 30.0, 900)
    assert endurance.ended(31.0, {"channel closed": 1.0}) == [Lost(31.0, "channel closed", False)]
    assert endurance.ended(32.0, {"channel closed": 1.0}) == []
    _look(endurance, 34.0, 900, live=False, mine=False)
    _look(endurance, 36.0, 5)
    found = endurance.fields()
    assert (found["connections"], found["reconnections"], found["seat_losses"]) == (2, 1, 1)
    assert (found["longest_silence_seconds"], found["pictures"]) == (4.0, 905)
    assert found["verdicts"]["no_connection_lost"] is False


def test_before_the_first_picture_nothing_is_a_silence() -> None:
    endurance = Endurance()
    _look(endurance, 5.0, 0, live=False, mine=False)
    _look(endurance, 9.0, 1)
    assert (endurance.reconnections, endurance.longest_silence) == (0, 0.0)


def test_something_beyond_the_tolerance_breaks_the_verdict_and_so_does_a_run_without_pictures() -> None:
    endurance = Endurance()
    endurance.look(0.0, live=True, mine=True, driving=True, streams=_streams(10, violations=1))
    assert endurance.fields()["verdicts"] == {
        "no_connection_lost": True,
        "nothing_beyond_tolerance": False,
        "pictures_came": True,
    }
    assert Endurance().fields()["verdicts"]["pictures_came"] is False


@pytest.mark.parametrize(
    ("at", "excused"), [(9.0, False), (12.0, True), (59.0, True), (61.0, False), (109.0, False), (115.0, True)]
)
def test_the_network_is_to_blame_in_a_long_outage_and_shortly_after(at: float, excused: bool) -> None:
    assert cut_for_long([PlannedOutage(at=10.0, lasts=20.0, every=100.0)], at) is excused
    assert not cut_for_long([PlannedOutage(at=10.0, lasts=19.0, every=100.0)], at)


def _run(*arguments: str) -> dict[str, object]:
    done = CliRunner().invoke(app, ["experiment", "endurance", *arguments, "--json", "-"])
    assert done.exit_code == 0, done.output
    found: dict[str, object] = json.loads(done.stdout)
    assert found["connections"] == 1
    assert found["violations"] == 0
    assert found["reconnections"] == 0
    return found


def test_the_command_drives_over_a_satellite_and_says_what_lasted() -> None:
    found = _run("--network", "satellite", "--seconds", "8")
    assert (found["profile"], found["client"]) == ("satellite", "headless")
    assert found["verdicts"] == {
        "no_connection_lost": True,
        "nothing_beyond_tolerance": True,
        "pictures_came": True,
    }


@pytest.mark.long
@pytest.mark.timeout(240)
@pytest.mark.parametrize("network", ["satellite", "lte-drive"])
def test_a_headless_connection_lasts_a_minute(network: str) -> None:
    """Checks of consent whose answers were not waited for ended every one on a satellite within 40 s."""
    _run("--network", network, "--seconds", "60")


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.timeout(240)
@pytest.mark.parametrize("browser", ["chromium", "firefox"])
def test_a_pages_connection_lasts_a_minute_over_a_satellite(browser: str) -> None:
    found = _run("--network", "satellite", "--client", browser, "--seconds", "60")
    assert found["seat_losses"] == 0
