"""Where a recording is worth looking at."""

from lockstep.protocol.actions import ActionReason, ActionState
from lockstep.protocol.messages import StopState
from lockstep.server.recording.format.records import ActionRecord, FeedbackRecord
from lockstep.server.recording.reading.bookmarks import STOP_SPACING, BookmarkFinder


def stops(*states: StopState, spacing: int = STOP_SPACING) -> list[tuple[int, str, str]]:
    """The marks of feedback that shows these stops, each with its place among them."""
    finder = BookmarkFinder()
    found: list[tuple[int, str, str]] = []
    for place, stop in enumerate(states):
        record = FeedbackRecord(epoch="e", event=place + 1, issue=1, time=0.0, axes=[], stop=stop)
        found += [(place, mark.kind, mark.text) for mark in finder.find(record, place * spacing)]
    return found


def held(number: int) -> StopState:
    return StopState(stopped=True, by="Bo", reason="smoke", number=number)


def test_a_stop_and_its_reset_are_marked_once_each() -> None:
    assert stops(StopState(), held(1), held(1), StopState(number=1), StopState(number=1)) == [
        (1, "stop", "Bo: smoke"),
        (3, "reset", ""),
    ]


def test_a_further_stop_while_one_holds_is_marked_with_its_number() -> None:
    assert stops(held(1), held(1), held(3)) == [(0, "stop", "Bo: smoke"), (2, "stop", "again, stop 3")]


def test_a_flood_of_stops_is_marked_once_a_second() -> None:
    assert len(stops(*(held(number) for number in range(1, 42)), spacing=STOP_SPACING // 10)) == 5


def test_stops_of_recordings_without_numbers_are_marked() -> None:
    assert [kind for _, kind, _ in stops(held(0), StopState(), held(0))] == ["stop", "reset", "stop"]


def test_the_end_of_an_action_is_marked_with_its_reason_or_its_result() -> None:
    def marked(state: ActionState, reason: ActionReason = "", text: str = "") -> list[tuple[int, str, str]]:
        record = ActionRecord(epoch="e", event=5, id="a", name="snapshot", state=state, by="", reason=reason, text=text)
        return [(mark.event, mark.kind, mark.text) for mark in BookmarkFinder().find(record, 0)]

    assert marked("running", text="waits for the picture") == []
    assert marked("done") == [(5, "action", "snapshot done")]
    assert marked("done", text="picture of event 4") == [(5, "action", "snapshot done: picture of event 4")]
    assert marked("cancelled", "rested", "1.0 m to go") == [(5, "action", "snapshot cancelled: rested")]
    assert marked("failed", text="x" * 500) == [(5, "action", ("snapshot failed: " + "x" * 500)[:200])]
