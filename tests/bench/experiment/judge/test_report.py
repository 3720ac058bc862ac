import re
from pathlib import Path
from xml.etree import ElementTree

from lockstep.bench.experiment.choices import Mode, media_of
from lockstep.bench.experiment.endurance.growth import Growth, Point
from lockstep.bench.experiment.judge.findings import Cell, Findings
from lockstep.bench.experiment.judge.report import write_report
from lockstep.bench.experiment.judge.results import result_of
from lockstep.emulator.impairment.profile import load_profile
from tests.bench.experiment.made_up import choices, client, run

PROFILE = load_profile("micro-lan")
MODES: tuple[Mode, ...] = ("off",)  # a figure takes a moment
OUTAGE = {
    "experiment": "outage",
    "network": "outage",
    "round_trip_ms": 40.0,
    "seconds": 10.0,
    "client": "headless",
    "outages": [
        {
            "packets": "lost",
            "rest_ms": 299.0,
            "hold_ms": 300.0,
            "oldest_answer_ms": 80.0,
            "max_event_age_ms": 2000.0,
            "control_ms": 250.0,
            "control_round_trips": 6.2,
            "rested_within_hold": True,
            "nothing_queued_executed": True,
            "control_within_2_s": True,
        }
    ],
    "verdicts": {"rested_within_hold": True},
}


def findings() -> Findings:
    found = Findings(machine={"cpu": "A <fast> one", "cores": 2, "python": "3.11"}, outages=[OUTAGE])
    for mode in MODES:
        said = choices(mode=mode)
        ran = run(client(gate=said.gate), client("watcher-off", "off", lag=7, drives=False))
        found.cells.append(Cell(said, PROFILE, result_of(said, media_of(PROFILE), ran, 0.1), ran))
    points = [Point("off", 1.0, rate, 10, 10, int(rate), 5) for rate in (2.0, 5.0)]
    found.growth = Growth("hong-kong", 2, (0.0, 1.0), [*points, Point("event", 1.0, 5.0, 10, 0, 0, 0)])
    return found


def test_the_page_has_every_figure_and_needs_nothing_else(tmp_path: Path) -> None:
    page = write_report(findings(), tmp_path / "report").read_text()
    assert page.count("<svg") == 2 + len(MODES) * 5 + 1  # compared; robot, two media, two gaps a run; growth
    assert "A &lt;fast&gt; one" in page
    assert not re.findall(r"(?:src|href)=['\"]https?:", page)
    for section in ("overview", "micro-lan", "growth", "outage"):
        assert f"id='{section}'" in page
    assert "<span class='bad'>5</span>" in page


def test_the_comparisons_are_files_of_their_own_too(tmp_path: Path) -> None:
    write_report(findings(), tmp_path)
    files = sorted(file.name for file in (tmp_path / "figures").iterdir())
    assert files == ["growth.svg", "micro-lan-audio.svg", "micro-lan-video.svg"]
    for name in files:
        ElementTree.parse(tmp_path / "figures" / name)


def test_a_failed_run_is_said(tmp_path: Path) -> None:
    page = write_report(Findings(failed=["satellite, off: no picture"]), tmp_path).read_text()
    assert "satellite, off: no picture" in page


def test_all_results_are_json_and_a_false_verdict_breaks_them() -> None:
    found = findings()
    assert len(found.results()) == len(MODES) + 2
    assert not Findings().broken
    assert found.broken == any(False in each["verdicts"].values() for each in found.results())
