"""Which record an event of a session becomes."""

import pytest

from lockstep.protocol.messages import Command, Refusal, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.recording.format.records import CommandRecord, RefusalRecord, StopRecord
from lockstep.server.recording.writing.event_records import RecordedEvent, record_of
from lockstep.server.session_events import (
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    Refused,
    ResetDone,
    StopAnswered,
    StopSent,
)
from lockstep.server.stop.stop_presses import Press

ADA = Actor("Ada", "operator", "p1", "l1")
COMMAND = Command(event=8, issue=2, values=[0.5, None], nonce=77)
PRESS = Press(id="a" * 32, by=ADA, where="stop", reason="too close")


@pytest.mark.parametrize(
    ("event", "outcome", "reason"),
    [
        (CommandForwarded(ADA, COMMAND), "forwarded", ""),
        (CommandRepeated(ADA, COMMAND, True), "repeated", ""),
        (CommandRefused(ADA, COMMAND, "late"), "refused", "late"),
        (CommandRefused(ADA, COMMAND, "link_down"), "undelivered", "link_down"),
    ],
)
def test_a_command_says_who_sent_it_and_what_became_of_it(event: RecordedEvent, outcome: str, reason: str) -> None:
    record = record_of(event, "e1", 7)
    assert isinstance(record, CommandRecord)
    assert (record.epoch, record.event, record.issue, record.values, record.nonce) == ("e1", 8, 2, [0.5, None], 77)
    assert (record.peer, record.name, record.kind) == ("p1", "Ada", "human")
    assert (record.outcome, record.reason) == (outcome, reason)


def test_a_refusal_has_the_event_that_is_current_and_the_one_that_was_refused() -> None:
    refusal = Refusal(event=5, reason="late", current=7, detail="two events ago")
    assert record_of(Refused(ADA, "command", refusal, "robot"), "e1", 99) == RefusalRecord(
        epoch="e1",
        event=7,
        refused=5,
        reason="late",
        detail="two events ago",
        by="robot",
        peer="p1",
        name="Ada",
    )


def test_a_stop_its_answer_and_its_reset_are_three_records() -> None:
    sent = record_of(StopSent(PRESS, False, True), "e1", 7)
    taken = record_of(StopAnswered(PRESS, StopTaken(press=PRESS.id, number=3, kept=False), False, False), "e1", 7)
    reset = record_of(ResetDone(ADA, "http", 3), "e1", 7)
    assert [sent, taken, reset] == [
        StopRecord(
            epoch="e1",
            event=7,
            kind="stop",
            by="Ada",
            where="stop",
            reason="too close",
            press=PRESS.id,
            delivered=False,
        ),
        StopRecord(epoch="e1", event=7, kind="taken", by="Ada", where="robot", press=PRESS.id, number=3, kept=False),
        StopRecord(epoch="e1", event=7, kind="reset", by="Ada", where="http", number=3),
    ]
