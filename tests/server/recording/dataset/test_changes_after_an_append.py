"""Changes of episodes that a dataset has: none of their events comes into it twice, under whatever id."""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pytest

from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset.appending import read_state
from lockstep.server.recording.dataset.commit import commit, stage_of
from lockstep.server.recording.episodes.edits import EpisodeEditRefused
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.export.lerobot_batch import write_notes
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.dataset.test_appending import events_of, follower
from tests.server.recording.episodes.test_edited_datasets import NEXT, change
from tests.server.recording.test_episode_export import KEPT_AND_NOT, episode, recording

C = KEPT_AND_NOT[4:6]  # events 45 to 60; NEXT has 70 to 90
KEPT = [[*range(45, 60)], [*range(70, 90)]]


def appended(path: Path, root: Path) -> list[str]:
    said: list[str] = []
    append_once([path], root, DatasetOptions(), said.append)
    assert verify_dataset(root).ok
    return said


class Way(NamedTuple):
    """A way to append: c and f of the recording are in the dataset, and `again` looks for more."""

    path: Path
    again: Callable[[], list[str]]  # what was said, with the number of those left out


@contextmanager
def by_append(tmp_path: Path) -> Iterator[Way]:
    path, root = recording(tmp_path / "a.mcap", *C, *NEXT), tmp_path / "dataset"
    appended(path, root)
    yield Way(path, lambda: appended(path, root))


@contextmanager
def by_follower(tmp_path: Path) -> Iterator[Way]:
    """One follower, which looks again when the recording has grown."""
    said: list[str] = []
    file, following = GrowingFile(tmp_path / "a.mcap", [*C, *NEXT], events=200), follower(tmp_path / "dataset", said)
    file.write_until(95)
    following.look([file.path])
    until = iter(range(130, 200, 30))

    def again() -> list[str]:
        said.clear()
        file.write_until(next(until))
        following.look([file.path])
        assert verify_dataset(tmp_path / "dataset").ok
        return [*said, f"{len(said)} left out"]

    yield Way(file.path, again)
    file.write_until(200)


@pytest.fixture(params=[by_append, by_follower])
def way(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Way]:
    with request.param(tmp_path) as found:
        yield found


def test_the_parts_of_an_episode_that_was_split_after_the_append_are_left_out_by_name(tmp_path: Path, way: Way) -> None:
    change(way.path, {"episode": "c", "split": 50})
    *said, total = way.again()
    assert said == [
        f"episode edit-1{part} of a.mcap is left out: the dataset has {count} of its {count} events already, as c, "
        "from before a change"
        for part, count in (("a", 5), ("b", 10))
    ]
    assert total.endswith("2 left out")
    assert events_of(tmp_path / "dataset") == KEPT


def test_an_episode_that_was_merged_after_the_append_is_left_out_by_name(tmp_path: Path, way: Way) -> None:
    change(way.path, {"episode": "c", "merge": "f"})
    assert way.again()[0] == (
        "episode edit-1 of a.mcap is left out: the dataset has 35 of its 45 events already, as c, f, "
        "from before a change"
    )
    assert events_of(tmp_path / "dataset") == KEPT


def test_an_episode_whose_split_was_taken_back_after_the_append_is_in_the_dataset_as_it_is(
    tmp_path: Path, way: Way
) -> None:
    change(way.path, {"episode": "c", "split": 50})
    assert len(way.again()) == 3
    change(way.path, {"undo": 1})
    (total,) = way.again()
    assert total.endswith("0 left out")
    assert events_of(tmp_path / "dataset") == KEPT


def test_the_whole_of_parts_that_the_dataset_has_is_left_out_when_the_split_is_taken_back(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *C, *NEXT), tmp_path / "dataset"
    change(path, {"episode": "c", "split": 50}, {"episode": "edit-1b", "dropped": True})
    appended(path, root)
    change(path, {"undo": 2})
    assert appended(path, root)[-1] == "1 appended, 0 left out"
    change(path, {"undo": 1})
    assert appended(path, root)[0].startswith("episode c of a.mcap is left out: the dataset has 15 of its 15 events")
    assert events_of(root) == [[*range(45, 50)], [*range(70, 90)], [*range(50, 60)]]


def test_a_dataset_notes_which_recorded_episodes_its_own_were_made_of(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *C, *NEXT), tmp_path / "dataset"
    change(path, {"episode": "c", "merge": "f"})
    appended(path, root)
    (noted,) = read_state(root).notes.episodes
    assert (noted.episode, noted.recorded) == ("edit-1", ("c", "f"))


def test_a_dataset_that_has_an_episode_twice_has_it_already(tmp_path: Path) -> None:
    """An earlier version wrote the episodes of a copy again."""
    path, root = recording(tmp_path / "a.mcap", *C, *NEXT), tmp_path / "dataset"
    appended(path, root)
    state = read_state(root)
    notes = msgspec.structs.replace(state.notes, episodes=[*state.notes.episodes, *state.notes.episodes])
    commit(root, [write_notes(stage_of(root), notes)])
    said: list[str] = []
    append_once([path], root, DatasetOptions(), said.append)
    assert said == ["0 appended, 0 left out"]
    change(path, {"episode": "c", "first_event": 50})
    append_once([path], root, DatasetOptions(), said.append)
    assert said[1:] == [
        "episode c of a.mcap is left out: the dataset has 10 of its 10 events already, as c, from before a change",
        "0 appended, 1 left out",
    ]


def test_a_whole_recording_is_in_the_dataset_whatever_the_task_that_is_chosen_later(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", events=30), tmp_path / "dataset"
    said: list[str] = []
    for task in ("push", "push", "pull"):
        append_once([path], root, DatasetOptions(task=task), said.append)
    assert said[2:] == [
        "1 appended, 0 left out",
        "0 appended, 0 left out",
        "a.mcap is left out: the dataset has it already, with the task 'push'",
        "0 appended, 1 left out",
    ]
    assert read_state(root).tasks == ["push"]


def random_change(chance: random.Random, path: Path, number: int) -> None:
    ids = ["a", "b", "c", *(f"edit-{each}{part}" for each in range(1, number) for part in ("", "a", "b"))]
    first, last = sorted(chance.sample(range(10, 90), 2))
    one: dict[str, Any] = chance.choice(
        [
            {"episode": chance.choice(ids), "split": first},
            {"episode": chance.choice(ids), "merge": chance.choice(ids)},
            {"episode": chance.choice(ids), "first_event": first, "last_event": last},
            {"episode": chance.choice(ids), "dropped": chance.random() < 0.5},
            {"undo": chance.randrange(1, number + 1)},
        ]
    )
    change(path, one)


@pytest.mark.parametrize("seed", range(4))
def test_whatever_changes_between_appends_no_event_of_a_recording_is_in_the_dataset_twice(
    tmp_path: Path, seed: int
) -> None:
    chance, root = random.Random(seed), tmp_path / "dataset"
    kept = [
        each
        for id, first, last in (("a", 10, 30), ("b", 30, 60), ("c", 65, 90))
        for each in (episode(id, "start", first, first), episode(id, "kept", first, last))
    ]
    path, number = recording(tmp_path / "a.mcap", *kept), 1
    for _ in range(6):
        for _ in range(40):
            try:
                random_change(chance, path, number)
            except EpisodeEditRefused:
                continue
            number += 1
            break
        appended(path, root)
    events = [event for each in events_of(root) for event in each]
    assert len(events) == len(set(events))
    assert len(events) > 20
