"""How long a command took, by the records of a recording."""

from lockstep.server.recording.format.records import CommandOutcome, CommandRecord, FeedbackRecord
from lockstep.server.recording.reading.command_delays import CommandDelays

MS = 1_000_000  # ns


def command(event: int, outcome: CommandOutcome = "forwarded") -> CommandRecord:
    return CommandRecord(epoch="e", event=event, issue=1, values=[], peer="p", name="Ada", outcome=outcome)


def feedback(event: int, issue: int = 1) -> FeedbackRecord:
    return FeedbackRecord(epoch="e", event=event, issue=issue, time=0.0, axes=[])


def test_a_command_takes_until_the_first_feedback_of_its_event() -> None:
    delays = CommandDelays()
    assert delays.take(command(7), 100 * MS) is None
    assert delays.take(feedback(6, 2), 110 * MS) is None, "another issue of the event before"
    assert delays.take(feedback(7), 118 * MS) == 18.0
    assert delays.take(feedback(7, 2), 200 * MS) is None


def test_a_repeat_and_a_refused_command_begin_nothing() -> None:
    delays = CommandDelays()
    delays.take(command(7), 100 * MS)
    delays.take(command(7, "repeated"), 110 * MS)
    delays.take(command(8, "refused"), 111 * MS)
    assert delays.take(feedback(7), 120 * MS) == 20.0
    assert delays.take(feedback(8), 130 * MS) is None


def test_other_records_say_nothing() -> None:
    assert CommandDelays().take(None, 1) is None
    assert CommandDelays().take(feedback(1), 1) is None, "its command is not in the recording"
