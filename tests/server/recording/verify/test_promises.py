"""What is promised is found kept in a good recording, and not kept in each kind of tampered one."""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any, Literal

import msgspec
import pytest

from lockstep.protocol.console import Report, StreamReport
from lockstep.protocol.messages import StopState
from lockstep.protocol.serial import MAX_EVENT
from lockstep.protocol.traces.trace import CommandSpans
from lockstep.server.recording.format.records import (
    ActionRecord,
    CommandRecord,
    FeedbackRecord,
    ReportRecord,
    StopRecord,
    TraceRecord,
)
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.verify.promises import CheckName
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import EPOCH, Story, own_entry, rewritten

Change = Callable[[Entry], list[Entry]]


def failed(path: Path) -> set[CheckName]:
    verdict = verify_file(path)
    assert verdict.ok == all(check.ok for check in verdict.checks.values())
    return {name for name, check in verdict.checks.items() if not check.ok}


@pytest.mark.parametrize("first_event", [1, MAX_EVENT - 20])
def test_a_good_recording_keeps_every_promise(tmp_path: Path, first_event: int) -> None:
    path = tmp_path / "a.mcap"
    Story(first_event=first_event, events=80).write(path)
    verdict = verify_file(path)
    assert failed(path) == set()
    assert (verdict.events, verdict.commands) == (79, 79)
    assert all(verdict.checks[name].looked for name in ("complete", "once", "in_time", "seat", "stamps", "rendered"))


def changed(entry: Entry, **values: object) -> Entry:
    assert entry.record is not None
    record = msgspec.structs.replace(entry.record, **values)
    return own_entry(record, entry.arrived, entry.captured)


def without_an_event(entry: Entry) -> list[Entry]:
    return [] if entry.event == 50 else [entry]


def with_an_event_that_goes_back(entry: Entry) -> list[Entry]:
    if entry.event == 50 and isinstance(entry.record, FeedbackRecord):
        return [entry, changed(entry, event=40, time=entry.record.time + 0.001)]
    return [entry]


def with_an_event_executed_twice(entry: Entry) -> list[Entry]:
    if entry.event == 50 and isinstance(entry.record, FeedbackRecord):
        return [entry, changed(entry, time=entry.record.time + 0.001)]
    return [entry]


def with_a_late_command(entry: Entry) -> list[Entry]:
    """As if the robot had executed events from 50 on three seconds later than it did."""
    if entry.event >= 50 and isinstance(entry.record, FeedbackRecord):
        return [changed(entry, time=entry.record.time + 3.0)]
    return [] if entry.event >= 50 and entry.record is None else [entry]


def with_a_stall(seconds: float = 2.22, *, voided: bool = False, spans_first: bool = False, **spans: Any) -> Change:
    """As if event 50 had been fed back 40 ms and `seconds` after the event before, of which the bridge says `spans`."""

    def change(entry: Entry) -> list[Entry]:
        if entry.event < 50 or not isinstance(entry.record, FeedbackRecord):
            return [] if entry.event >= 50 and entry.record is None else [entry]
        late = changed(entry, time=entry.record.time + seconds, neutral_needed=voided and entry.event == 50)
        if entry.event != 50 or not spans:
            return [late]
        about = {name: value for name, value in spans.items() if not name.endswith("_ms")}
        command = CommandSpans(**{name: value for name, value in spans.items() if name.endswith("_ms")})
        record = TraceRecord(**{"epoch": EPOCH, "event": 50, "command": command, **about})
        trace = own_entry(record, entry.arrived, entry.captured)
        return [trace, late] if spans_first else [late, trace]

    return change


def spans_of(tick_wait: float = 4, apply: float = 1, rate_wait: float = 0) -> dict[str, Any]:
    return {"tick_wait_ms": tick_wait, "apply_ms": apply, "rate_wait_ms": rate_wait}


def with_somebody_elses_command(entry: Entry) -> list[Entry]:
    if entry.event == 50 and isinstance(entry.record, CommandRecord):
        return [changed(entry, peer="p2")]
    return [entry]


def with_a_command_while_stopped(entry: Entry) -> list[Entry]:
    if entry.event == 50 and isinstance(entry.record, CommandRecord):
        stop = StopRecord(epoch=EPOCH, event=49, kind="stop", by="Bo", where="stop")
        return [own_entry(stop, entry.arrived), entry]
    return [entry]


def stop_record(kind: Literal["stop", "taken", "reset"], press: str = "", number: int = 0) -> StopRecord:
    return StopRecord(epoch=EPOCH, event=49, kind=kind, by="Bo", where="stop", press=press, number=number)


def with_stop_records(*records: StopRecord) -> Change:
    """Before the command of event 50; what the feedback says from then on is stop 7, not stopped."""

    def change(entry: Entry) -> list[Entry]:
        if isinstance(entry.record, FeedbackRecord) and entry.event >= 49:
            return [changed(entry, stop=StopState(number=7))]
        if entry.event == 50 and isinstance(entry.record, CommandRecord):
            return [*(own_entry(record, entry.arrived) for record in records), entry]
        return [entry]

    return change


def with_nonces(of_command: int) -> Change:
    """Of issues and commands alike, but for the command of event 50."""

    def change(entry: Entry) -> list[Entry]:
        if isinstance(entry.record, FeedbackRecord):
            return [changed(entry, nonce=1000 + entry.event)]
        if isinstance(entry.record, CommandRecord):
            return [changed(entry, nonce=of_command if entry.event == 50 else 999 + entry.event)]
        return [entry]

    return change


def with_a_stop_number_that_goes_back(entry: Entry) -> list[Entry]:
    if isinstance(entry.record, FeedbackRecord):
        return [changed(entry, stop=StopState(number=6 if entry.event > 50 else 7))]
    return [entry]


def with_a_picture_stamped_too_new(entry: Entry) -> list[Entry]:
    return [entry._replace(event=51)] if entry.topic == CAMERA + "front" and entry.event == 50 else [entry]


def with_a_command_that_was_never_forwarded(entry: Entry) -> list[Entry]:
    return [] if entry.event == 50 and isinstance(entry.record, CommandRecord) else [entry]


def with_something_rendered_beyond_the_tolerance(entry: Entry) -> list[Entry]:
    if isinstance(entry.record, ReportRecord) and entry.event > 60:
        stream = StreamReport(stream="front", carrier="native", violations=1)
        return [changed(entry, report=Report(event=entry.event, streams=[stream]))]
    return [entry]


def with_another_epoch(entry: Entry) -> list[Entry]:
    return [changed(entry, epoch="other")] if entry.event == 50 and entry.record is not None else [entry]


@pytest.mark.parametrize(
    ("tamper", "check"),
    [
        (without_an_event, "complete"),
        (with_an_event_that_goes_back, "monotonic"),
        (with_an_event_executed_twice, "once"),
        (with_a_late_command, "in_time"),
        (with_a_stall(), "in_time"),  # without its spans nobody knows when it executed
        (with_a_stall(**spans_of()), "in_time"),  # it came late, and the bridge was quick
        (with_a_stall(**spans_of(tick_wait=520)), "in_time"),  # its tick was late, and nothing voided it
        (with_a_stall(measure_ms=520), "in_time"),
        (with_a_stall(**spans_of(apply=3000)), "in_time"),  # it cannot have come before the feedback that it answers
        (with_a_stall(**spans_of(apply=520), peer="p1"), "in_time"),  # the operator's page says so, not the bridge
        (with_a_stall(**spans_of(apply=520), event=49), "in_time"),
        (with_a_stall(3.0, voided=True, **spans_of(tick_wait=520)), "in_time"),
        (with_somebody_elses_command, "seat"),
        (with_a_command_while_stopped, "stopped"),
        (with_stop_records(stop_record("stop", "a")), "stopped"),
        (with_stop_records(stop_record("stop", "a"), stop_record("reset", number=7)), "stopped"),
        (with_stop_records(stop_record("stop", "a"), stop_record("taken", "b", 7)), "stopped"),
        (with_stop_records(stop_record("stop", "a"), stop_record("taken", "a", 8)), "stopped"),
        (with_stop_records(stop_record("reset", number=6)), "stopped"),
        (with_a_stop_number_that_goes_back, "stopped"),
        (with_nonces(1), "in_time"),
        (with_nonces(0), "in_time"),
        (with_a_picture_stamped_too_new, "stamps"),
        (with_a_command_that_was_never_forwarded, "once"),
        (with_something_rendered_beyond_the_tolerance, "rendered"),
        (with_another_epoch, "monotonic"),
    ],
)
def test_a_tampered_recording_fails_the_check_that_it_breaks(tmp_path: Path, tamper: Change, check: CheckName) -> None:
    path = rewritten(tmp_path / "a.mcap", Story(events=80).entries(), tamper)
    assert check in failed(path)


@pytest.mark.parametrize(
    "change",
    [
        with_a_stall(voided=True, **spans_of(tick_wait=520)),
        with_a_stall(**spans_of(apply=520)),
        with_a_stall(spans_first=True, **spans_of(rate_wait=520)),
    ],
    ids=["before its tick, which brought the robot to rest", "in its tick", "after its tick"],
)
def test_a_bridge_that_took_a_command_in_time_and_was_held_up_then_has_kept_its_promise(
    tmp_path: Path, change: Change
) -> None:
    assert failed(rewritten(tmp_path / "a.mcap", Story(events=80).entries(), change)) == set()


def test_what_verify_cannot_know_it_does_not_claim(tmp_path: Path) -> None:
    files, answers = count(), "after the feedback that it answers"

    def text(change: Change) -> str:
        path = rewritten(tmp_path / f"{next(files)}.mcap", Story(events=80).entries(), change)
        [violation] = verify_file(path).checks["in_time"].violations
        return violation.text

    assert text(with_a_stall()) == f"executed at most 2.260 s {answers}: when is not recorded; 2 s are allowed"
    assert text(with_a_stall(**spans_of())) == f"executed 2.255 s {answers}; 2 s are allowed"
    late_tick = text(with_a_stall(**spans_of(tick_wait=520)))
    assert late_tick == f"executed 2.259 s {answers}, because its tick was late; 2 s are allowed"


@pytest.mark.parametrize(
    "change",
    [
        with_stop_records(stop_record("stop", "a"), stop_record("taken", "a", 7), stop_record("reset", number=7)),
        with_stop_records(
            stop_record("stop", "a"),
            stop_record("stop", "b"),
            *(stop_record("taken", press, 7) for press in ("a", "b")),
        ),
        with_nonces(1049),
        with_stop_records(stop_record("stop"), stop_record("reset")),
    ],
    ids=["taken and reset", "two presses", "nonces", "of before there were presses and numbers"],
)
def test_a_recording_with_stops_that_are_over_and_with_nonces_keeps_every_promise(
    tmp_path: Path, change: Change
) -> None:
    assert failed(rewritten(tmp_path / "a.mcap", Story(events=80).entries(), change)) == set()


def test_presses_without_an_answer_of_their_own_end_when_a_later_one_is_taken(tmp_path: Path) -> None:
    presses = [stop_record("stop", str(number)) for number in range(70)]
    answers = [stop_record("taken", str(number), 7) for number in range(6, 70)]
    change = with_stop_records(*presses, *answers)
    assert failed(rewritten(tmp_path / "a.mcap", Story(events=80).entries(), change)) == set()


def test_bytes_that_were_changed_without_their_checksum_fail(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80).write(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    assert "readable" in failed(path)


def test_an_interrupted_recording_is_not_taken_for_a_whole_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80).write(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    assert failed(path) == {"readable"}


def action(id: str, state: Literal["running", "done"], event: int = 50) -> ActionRecord:
    return ActionRecord(epoch=EPOCH, event=event, id=id, name="home", state=state, by="Ada", moves=True)


def named_by_commands(entry: Entry, id: str, until: int) -> Entry:
    """Commands of events up to `until` let the action go on."""
    if isinstance(entry.record, CommandRecord) and entry.event <= until:
        return changed(entry, action=id)
    return entry


def with_actions(named_until: int, *records: tuple[int, ActionRecord]) -> Change:
    """The records right behind the feedback of their events."""

    def change(entry: Entry) -> list[Entry]:
        added = [each for event, each in records if entry.event == event and isinstance(entry.record, FeedbackRecord)]
        return [
            named_by_commands(entry, "a", named_until),
            *(own_entry(each, entry.arrived + index + 1) for index, each in enumerate(added)),
        ]

    return change


@pytest.mark.parametrize(
    ("named_until", "records", "wrong"),
    [
        (79, [(20, action("a", "running")), (70, action("a", "done"))], set[CheckName]()),
        (30, [(20, action("a", "running")), (70, action("a", "done"))], {"actions"}),
        (79, [(20, action("a", "running")), (21, action("b", "running")), (22, action("a", "done"))], {"actions"}),
        (79, [(20, action("a", "running")), (22, action("a", "done")), (23, action("a", "running"))], {"actions"}),
    ],
)
def test_an_action_begins_once_alone_and_only_while_commands_name_it(
    tmp_path: Path, named_until: int, records: list[tuple[int, ActionRecord]], wrong: set[CheckName]
) -> None:
    path = tmp_path / "a.mcap"
    rewritten(path, Story(events=80).entries(), with_actions(named_until, *records))
    assert failed(path) == wrong
