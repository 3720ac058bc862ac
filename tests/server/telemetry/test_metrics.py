import platform
from collections import Counter
from importlib.metadata import version

from lockstep.protocol.actions import Status, StatusItem
from lockstep.protocol.console import Seat
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.server.audit.records import Actor
from lockstep.server.control.session_metrics import SessionMetrics
from lockstep.server.recording.episodes.metrics import count_episodes
from lockstep.server.recording.writing.episode_written import EpisodeEnded
from lockstep.server.session_events import EpochBegan, SeatChanged, SessionEvents, StatusReceived
from lockstep.server.telemetry.metrics import MAX_LIMITS, MAX_STATUS_NAMES, Metrics


def test_what_the_links_count_is_added_once() -> None:
    metrics = Metrics()
    for total in (2, 2, 5):
        metrics.collect(Counter(malformed=total), Counter(overview=total))
    found = metrics.registry.get_sample_value
    assert found("lockstep_bad_input_total", {"where": "robot", "reason": "malformed"}) == 5
    assert found("lockstep_dropped_total", {"queue": "robot overview"}) == 5


async def test_two_consoles_in_one_process_count_apart() -> None:
    first, second = Metrics(), Metrics()
    first.resets.inc()
    assert b"lockstep_resets_total 1.0" in await first.exposition.text()
    assert b"lockstep_resets_total 0.0" in await second.exposition.text()


async def test_what_runs_is_said_once_and_no_series_says_when_it_was_made() -> None:
    metrics = Metrics()
    metrics.resets.inc()
    text = (await metrics.exposition.text()).decode()
    assert (
        f'lockstep_build_info{{python="{platform.python_version()}",version="{version("lockstep-console")}"}} 1.0'
        in text
    )
    assert "_created" not in text


def test_a_robot_that_calls_its_limits_ever_new_names_makes_no_series_without_end() -> None:
    metrics = Metrics()
    for number in range(2 * MAX_LIMITS):
        metrics.limits_acted([f"limit {number}", "limit 0"])
    found_all = (sample for metric in metrics.limited.collect() for sample in metric.samples)
    series = [each for each in found_all if each.name.endswith("_total")]
    assert len(series) == MAX_LIMITS + 1
    found = metrics.registry.get_sample_value
    assert found("lockstep_limited_feedback_total", {"limit": "other"}) == MAX_LIMITS
    assert found("lockstep_limited_feedback_total", {"limit": "limit 0"}) == 2 * MAX_LIMITS + 1


def status(**values: float | bool) -> Status:
    return Status(event=1, items=[StatusItem(name=name, label=name, value=values[name]) for name in values])


def test_the_numbers_of_a_status_are_gone_with_their_items_and_its_names_stay_few() -> None:
    metrics = Metrics()
    metrics.status_shown(status(battery=0.5, heat=40.0))
    metrics.status_shown(status(battery=0.4))
    value = metrics.registry.get_sample_value
    assert (value("lockstep_status_value", {"item": "battery"}), value("lockstep_status_value", {"item": "heat"})) == (
        0.4,
        None,
    )
    metrics.status_shown(status(heat=41.0))
    assert value("lockstep_status_value", {"item": "heat"}) == 41.0
    for number in range(2 * MAX_STATUS_NAMES):
        metrics.status_shown(status(**{f"n{number}": 1.0}))
    assert value("lockstep_status_value", {"item": f"n{2 * MAX_STATUS_NAMES - 1}"}) is None


def test_a_new_epoch_takes_the_status_of_the_last_one_with_it() -> None:
    metrics = Metrics()
    events = SessionEvents(metrics.faults)
    SessionMetrics(metrics).subscribe(events)
    events.publish(StatusReceived(status(battery=0.5)))
    value = metrics.registry.get_sample_value
    assert value("lockstep_status_items", {"level": "ok"}) == 1
    events.publish(EpochBegan(DESCRIPTION))
    assert value("lockstep_status_value", {"item": "battery"}) is None
    assert value("lockstep_status_items", {"level": "ok"}) == 0


def test_the_seats_holders_are_counted_by_kind_and_episodes_by_their_end() -> None:
    metrics = Metrics()
    events = SessionEvents(metrics.faults)
    SessionMetrics(metrics).subscribe(events)
    count_episodes(events, metrics)
    ada, net = Seat(holder="p1", name="Ada", kind="human"), Seat(holder="p2", name="net", kind="policy")
    for seat in (Seat(), ada, ada, net, ada, Seat()):
        events.publish(SeatChanged(seat, Actor(), Actor()))
    value = metrics.registry.get_sample_value
    counted = {kind: value("lockstep_seat_changes_total", {"kind": kind}) for kind in ("human", "policy", "none")}
    assert counted == {"human": 2, "policy": 1, "none": 1}
    events.publish(EpisodeEnded("kept"))
    events.publish(EpisodeEnded("discarded"))
    events.publish(EpisodeEnded("kept"))
    ends = {end: value("lockstep_episodes_total", {"end": end}) for end in ("kept", "discarded", "cut")}
    assert ends == {"kept": 2, "discarded": 1, "cut": None}
