from typing import Any

import pytest

from lockstep.bench.experiment.choices import media_of
from lockstep.bench.experiment.judge.results import result_of
from lockstep.bench.experiment.judge.table import COLUMNS, render_table, rows_of
from lockstep.emulator.impairment.profile import load_profile
from tests.bench.experiment.made_up import choices, client, run

MEDIA = media_of(load_profile("micro-lan"))


def found(*clients: Any, round_trip: float = 0.1, **said: Any) -> dict[str, Any]:
    return result_of(choices(**said), MEDIA, run(*clients), round_trip)


def test_counts_are_those_of_the_run_alone() -> None:
    figures = found()["clients"]["operator"]["streams"]["overview"]
    counts = {name: figures[name] for name in ("received", "rendered", "discarded", "held", "violations")}
    assert counts == {"received": 20, "rendered": 10, "discarded": 10, "held": 0, "violations": 0}
    assert (figures["max_gap"], figures["mean_gap"], figures["rendered_share"]) == (1, 1.0, 0.5)
    assert figures["age_ms"]["p50"] == 20.0


def test_rates_and_delays_are_of_the_client() -> None:
    operator = found()["clients"]["operator"]
    assert operator["event_rate"] == pytest.approx(10)
    assert operator["command_to_picture_ms"] == {"count": 9, "median": 30.0, "p95": 50.0, "p99": 60.0}
    watcher = found(client(), client("watcher-off", "off", drives=False))["clients"]["watcher-off"]
    assert watcher["command_to_picture_ms"] is None


def test_what_a_baseline_renders_beyond_the_tolerance_breaks_no_promise() -> None:
    result = found(client(), client("watcher-off", "off", lag=7, drives=False))
    assert result["clients"]["watcher-off"]["streams"]["overview"]["violations"] == 10
    assert result["verdicts"]["no_violation"]


def test_what_the_event_gate_renders_beyond_the_tolerance_does() -> None:
    assert not found(client(lag=7))["verdicts"]["no_violation"]


def test_a_gate_that_does_not_count_its_violations_is_found_out() -> None:
    record = client(lag=7)
    record.statistics = client().statistics
    assert not found(record)["verdicts"]["no_violation"]


def test_a_picture_whose_pixels_say_another_event_is_a_broken_promise() -> None:
    record = client()
    record.drawn_wrong = 1
    assert found(record)["verdicts"]["pixels_agree"] is False


def test_where_no_event_could_be_read_in_a_picture_nothing_is_said_of_the_pixels() -> None:
    record = client()
    record.drawn_right, record.drawn_unreadable = 0, 10
    assert found(record)["verdicts"]["pixels_agree"] is None


def test_the_shares_are_promised_for_media_pacing_up_to_350_ms_alone() -> None:
    asked = "rendered_90_percent", "within_99_percent"
    assert [found(mode="media")["verdicts"][name] for name in asked] == [False, True]
    assert [found()["verdicts"][name] for name in asked] == [None, None]
    assert [found(mode="media", round_trip=0.6)["verdicts"][name] for name in asked] == [None, None]


def test_the_page_names_its_streams_instead_of_listing_them() -> None:
    record = client()
    for said in (record.statistics_before, record.statistics):
        said["streams"] = {stream.pop("stream"): stream for stream in said["streams"]}
    assert found(record)["clients"]["operator"]["streams"]["overview"]["received"] == 20


def test_the_table_has_a_line_for_each_client_and_stream() -> None:
    result = found(client(), client("watcher-off", "off", drives=False))
    rows = rows_of(result)
    assert [row[2:4] for row in rows] == [
        ["operator", "microphone"],
        ["operator", "overview"],
        ["watcher-off", "microphone"],
        ["watcher-off", "overview"],
    ]
    assert {len(row) for row in rows} == {len(COLUMNS)}
    assert len(render_table([result]).splitlines()) == 5


def test_without_a_gate_sound_is_judged_as_the_thesis_player_would_have_played_it_too() -> None:
    streams = found(client(gate="off"))["clients"]["operator"]["streams"]
    assert streams["overview"]["thesis_player"] is None
    assert streams["microphone"]["thesis_player"]["max_gap"] in (1, 2)
    assert found()["clients"]["operator"]["streams"]["microphone"]["thesis_player"] is None
