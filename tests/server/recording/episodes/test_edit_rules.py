"""The rules of changes: what a split, a merge, a trim and an undo mean, and that nothing makes more count."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.serial import MAX_EVENT, event_after, event_gap
from lockstep.server.recording.episodes.edit_rules import EditedEpisode, EpisodeEdit, apply_edits, edited
from lockstep.server.recording.format.episodes import EpisodeEntry


def entry(id: str, first: int, last: int, state: str = "kept", **more: Any) -> EpisodeEntry:
    fields: dict[str, Any] = {"number": 1, "task": "push", "started": first, "ended": last, **more}
    return EpisodeEntry(id=id, state=state, first_event=first, last_event=last, **fields)  # type: ignore[arg-type]


def edit(episode: str = "", **change: Any) -> EpisodeEdit:
    return EpisodeEdit(episode=episode, at=1.0, **change)


RECORDED = [
    entry("a", 10, 20, outcome="success", drivers=["Ada"], problems=["no_events"], marks=[(12, "m"), (15, "n")]),
    entry("b", 25, 40, outcome="failure", drivers=["Bo"]),
    entry("c", 45, 60, "discarded"),
    entry("d", 65, 80, outcome="failure"),
]


def stretches(*edits: EpisodeEdit | None) -> list[tuple[str, int, int, str]]:
    return [(each.id, each.first_event, each.last_event, each.state) for each in edited(RECORDED, edits)]


def only(found: list[EditedEpisode], id: str) -> EditedEpisode:
    (one,) = [each for each in found if each.entry.id == id]
    return one


def test_a_split_makes_two_parts_that_share_the_event_and_have_each_row_once() -> None:
    found = apply_edits(RECORDED, [edit("a", split=15)]).episodes
    first, second = found[0], found[1]
    assert (first.entry.id, first.entry.first_event, first.entry.last_event) == ("edit-1a", 10, 15)
    assert (second.entry.id, second.entry.first_event, second.entry.last_event) == ("edit-1b", 15, 20)
    assert [first.entry.marks, second.entry.marks] == [[(12, "m")], [(15, "n")]]
    assert {each.entry.outcome for each in (first, second)} == {"success"}
    assert first.recorded == second.recorded == ("a",)
    assert (first.first_bound, first.last_bound, second.first_bound, second.last_bound) == (10, 15, 15, 20)


def test_a_part_is_changed_alone_and_its_trim_stays_within_the_part() -> None:
    changes = [edit("a", split=15), edit("edit-1b", task="pull", first_event=17), edit("edit-1b", first_event=14)]
    result = apply_edits(RECORDED, changes)
    part = only(result.episodes, "edit-1b").entry
    assert (part.task, part.first_event) == ("pull", 17)
    assert only(result.episodes, "edit-1a").entry.task == "push"
    assert result.without_effect == {3: "a trim stays within the events 15 to 20"}


@pytest.mark.parametrize("task", ["", "  "])
def test_an_episode_keeps_its_task_where_it_would_have_none(task: str) -> None:
    result = apply_edits(RECORDED, [edit("a", task=task, outcome="failure")])
    assert only(result.episodes, "a").entry == RECORDED[0]
    assert result.without_effect == {1: "a task is said in words"}


def test_a_trim_can_be_widened_again_up_to_what_was_recorded() -> None:
    assert stretches(edit("a", first_event=15), edit("a", first_event=10))[0] == ("a", 10, 20, "kept")


def test_a_merge_is_of_neighbours_and_contains_what_was_between_them() -> None:
    (merged, *_) = apply_edits(RECORDED, [edit("a", merge="b")]).episodes
    assert (merged.entry.id, merged.entry.first_event, merged.entry.last_event) == ("edit-1", 10, 40)
    assert merged.recorded == ("a", "b")
    assert (merged.entry.drivers, merged.entry.problems) == (["Ada", "Bo"], ["no_events"])
    assert merged.entry.outcome == "", "they did not agree"
    assert merged.entry.ended == 40


def test_a_merge_cannot_take_in_a_discarded_episode_that_lies_between() -> None:
    result = apply_edits(RECORDED, [edit("b", merge="d"), edit("b", merge="c")])
    assert [each.entry.id for each in result.episodes] == ["a", "b", "c", "d"]
    assert result.without_effect.keys() == {1, 2}


def test_a_merge_cannot_take_in_a_part_that_was_discarded() -> None:
    split = (edit("b", split=30), edit("edit-1b", split=35), edit("edit-2a", dropped=True))
    kept = stretches(*split)
    assert stretches(*split, edit("edit-1a", merge="edit-2b")) == kept
    assert stretches(*split, edit("edit-1a", merge="edit-2a")) == kept
    assert ("edit-5", 25, 35, "kept") in stretches(
        *split, edit("edit-2a", dropped=False), edit("edit-1a", merge="edit-2a")
    )


def test_parts_that_are_merged_again_are_the_episode_that_they_were() -> None:
    assert stretches(edit("a", split=15), edit("edit-1a", merge="edit-1b"))[0] == ("edit-2", 10, 20, "kept")


@pytest.mark.parametrize("event", [9, 10, 20, 21, 0, 2**31 + 15])
def test_a_split_is_inside_of_the_episode(event: int) -> None:
    assert apply_edits(RECORDED, [edit("a", split=event)]).without_effect.keys() == {1}


def test_a_discarded_episode_is_restored_and_a_recorded_discard_is_not() -> None:
    found = apply_edits(RECORDED, [edit("a", dropped=True)]).episodes[0]
    assert (found.entry.state, found.is_dropped, found.is_editable) == ("discarded", True, True)
    assert stretches(edit("a", dropped=True), edit("a", dropped=False))[0][3] == "kept"
    assert stretches(edit("c", dropped=False), edit("c", task="x"))[2] == ("c", 45, 60, "discarded")


def test_an_undo_takes_back_one_change_and_leaves_the_others() -> None:
    changes = [edit("a", task="pull"), edit("b", task="wipe"), edit(undo=1)]
    assert [each.task for each in edited(RECORDED, changes)] == ["push", "wipe", "push", "push"]


def test_what_was_made_of_an_undone_split_is_gone_with_it() -> None:
    result = apply_edits(RECORDED, [edit("a", split=15), edit("edit-1a", task="x"), edit(undo=1)])
    assert (result.undone, set(result.without_effect)) == ({1}, {2})
    assert [each.entry for each in result.episodes] == RECORDED


@pytest.mark.parametrize("number", [0, 1, 2, 3, 9])
def test_an_undo_names_an_earlier_change_that_is_in_effect(number: int) -> None:
    changes = [edit("a", task="pull"), edit(undo=1), edit(undo=number)]
    assert edited(RECORDED, changes) == RECORDED
    assert 3 in apply_edits(RECORDED, changes).without_effect


def test_a_line_with_several_kinds_of_change_or_none_has_no_effect() -> None:
    lines = [edit("a", task="x", split=15), edit("a", split=15, merge="b"), edit("a"), edit(undo=1, task="x"), None]
    result = apply_edits(RECORDED, lines)
    assert [each.entry for each in result.episodes] == RECORDED
    assert result.without_effect.keys() == {1, 2, 3, 4, 5}


def test_a_part_gets_no_id_that_an_episode_has_already() -> None:
    recorded = [entry("a", 10, 20), entry("edit-1b", 30, 40)]
    assert [each.id for each in edited(recorded, [edit("a", split=15)])] == ["a", "edit-1b"]


def test_events_are_compared_across_the_wrap_of_the_event_reference() -> None:
    first, last = MAX_EVENT - 5, 5
    found = edited([entry("a", first, last)], [edit("a", split=event_after(MAX_EVENT)), edit("edit-1b", last_event=3)])
    assert [(each.first_event, each.last_event) for each in found] == [(first, 1), (1, 3)]


IDS = ["a", "b", "c", "d", *(f"edit-{number}{part}" for number in range(1, 6) for part in ("", "a", "b"))]
EVENTS = st.none() | st.integers(0, 90)
EDITS = st.builds(
    edit,
    st.sampled_from(IDS),
    first_event=EVENTS,
    last_event=EVENTS,
    dropped=st.none() | st.booleans(),
    split=EVENTS,
    merge=st.none() | st.sampled_from(IDS),
    undo=st.none() | st.integers(0, 9),
)
ONE_KIND = EDITS.map(
    lambda each: (
        each
        if each.kinds < 2
        else edit(each.episode, split=each.split)
        if each.split is not None
        else edit(each.episode, merge=each.merge)
        if each.merge is not None
        else edit(undo=each.undo)
    )
)


@given(st.lists(ONE_KIND | EDITS | st.none(), max_size=12))
def test_whatever_is_written_kept_episodes_never_overlap_nor_touch_what_was_not_kept(
    edits: list[EpisodeEdit | None],
) -> None:
    found = apply_edits(RECORDED, edits).episodes
    events: list[int] = []
    for each in found:
        assert event_gap(each.entry.first_event, each.first_bound) >= 0
        assert event_gap(each.last_bound, each.entry.last_event) >= 0
        if each.entry.state == "kept":
            events += range(each.entry.first_event, each.entry.last_event)
    assert len(events) == len(set(events)), "no event is in two rows"
    assert not set(events) & set(range(45, 60)), "none is of the discarded episode"
    assert set(events) <= set(range(10, 40)) | set(range(65, 80))
