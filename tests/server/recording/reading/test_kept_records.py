"""Which records are of kept episodes: by their events, and only until the episode has ended."""

from pathlib import Path

from lockstep.server.recording.export.lerobot_rows import episodes_now
from lockstep.server.recording.format.records import CommandRecord, EpisodeRecord, FeedbackRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.kept_records import KeptRecords
from lockstep.server.recording.reading.reader import Record, RecordingReader
from tests.server.recording.makers import EPOCH, INTERVAL, START, own_entry
from tests.server.recording.test_episode_export import KEPT_AND_NOT, changed, episode, recording

FEEDBACK, COMMANDS, EPISODES = (OWN_TOPICS[kind] for kind in (FeedbackRecord, CommandRecord, EpisodeRecord))


def taken(path: Path, topic: str) -> list[Record]:
    with RecordingReader(path) as reader:
        kept = KeptRecords(episodes_now(reader))
        return [each for each in reader.records() if each.topic == topic and kept.takes(each)]


def events(path: Path, topic: str = FEEDBACK) -> list[int]:
    return [each.event for each in taken(path, topic)]


def test_an_episode_has_the_events_behind_its_first_up_to_its_last(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    assert events(path) == [*range(11, 21), *range(46, 61)]
    changed(path, "a", dropped=True)
    changed(path, "c", first_event=50, last_event=52)
    assert events(path) == [51, 52]
    none = recording(tmp_path / "b.mcap")
    assert events(none) == []


def test_one_record_with_the_event_of_another_time_hides_no_later_one(tmp_path: Path) -> None:
    """A client names the event of a command, also of one that is refused."""
    far = CommandRecord(
        epoch=EPOCH, event=5000, issue=1, peer="p", name="Bo", outcome="refused", reason="no_seat", values=[]
    )
    path = recording(tmp_path / "a.mcap", own_entry(far, START + INTERVAL // 2), *KEPT_AND_NOT)
    assert events(path, COMMANDS) == [*range(11, 21), *range(46, 61)]


def test_what_comes_while_the_last_event_still_holds_is_of_no_kept_episode(tmp_path: Path) -> None:
    """Nobody drives, or the next take has begun and is discarded later: the bridge issues the same event again."""
    again = FeedbackRecord(epoch=EPOCH, event=20, issue=2, time=101.0, axes=[0.2, 0.0], joints=[20.0, 0.0, 0.5])
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT, own_entry(again, START + 19 * INTERVAL + 35_000_000))
    assert events(path) == [*range(11, 21), *range(46, 61)]


def test_a_mark_goes_with_its_event_and_the_rest_of_an_episode_with_it(tmp_path: Path) -> None:
    marks = [episode("a", "mark", 10, event, text=f"at {event}") for event in (13, 18)]
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT, *marks)
    assert events(path, EPISODES) == [10, 13, 18, 20, 45, 60]
    changed(path, "a", split=15)
    changed(path, "edit-1b", dropped=True)
    assert events(path, EPISODES) == [10, 13, 20, 45, 60]
    assert events(path)[:5] == [*range(11, 16)]
