"""`lockstep episodes`, and `export` and `verify` of datasets, as their users call them."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from lockstep.server.cli.main import app
from tests.server.recording.makers import INFO
from tests.server.recording.test_episode_export import KEPT_AND_NOT, OTHER, episode, recording


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Where recordings are; two are there, each with two kept episodes."""
    found = tmp_path / "recordings"
    found.mkdir()
    for name in ("one", "two"):
        recording(found / f"{name}.mcap", *KEPT_AND_NOT)
    return found


def _lockstep(directory: Path, *arguments: str) -> Result:
    environment = {
        "LOCKSTEP_STATE_DIR": str(directory.parent / "state"),
        "LOCKSTEP_RECORDING__DIRECTORY": str(directory),
    }
    return CliRunner().invoke(app, arguments, env=environment)


def test_the_episodes_of_a_recording_are_listed_and_one_is_relabelled(directory: Path) -> None:
    words = _lockstep(directory, "episodes", "one")
    assert words.exit_code == 0, words.output
    assert [line.split()[2] for line in words.stdout.splitlines()] == ["kept", "discarded", "kept", "cut", "open"]
    changed = json.loads(
        _lockstep(directory, "episodes", "one", "--edit", "a", "--outcome", "failure", "--json").stdout
    )
    assert [(each["id"], each["outcome"]) for each in changed][:1] == [("a", "failure")]
    assert json.loads(_lockstep(directory, "episodes", "one", "--json").stdout) == changed


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--edit", "b", "--undrop"), "no kept episode"),
        (("--edit", "a", "--last", "99"), "stays within"),
        (("--edit", "a", "--outcome", "good"), "'good' is not one of"),
        (("--edit", "a", "--first", "-3"), ""),
    ],
)
def test_what_cannot_be_changed_is_said_with_exit_code_2(
    directory: Path, arguments: tuple[str, ...], words: str
) -> None:
    found = _lockstep(directory, "episodes", "one", *arguments)
    assert found.exit_code == 2
    assert words in found.stderr
    assert sorted(each.name for each in directory.iterdir()) == ["one.mcap", "two.mcap"]


def test_the_episodes_of_all_recordings_are_listed_and_chosen_by_what_they_are(directory: Path) -> None:
    (directory / "broken.mcap").write_bytes(b"no recording")
    _lockstep(directory, "episodes", "two", "--edit", "c", "--outcome", "success")
    words = _lockstep(directory, "episodes")
    assert words.exit_code == 0, words.output
    assert "broken.mcap" in words.stderr
    assert [line for line in words.stdout.splitlines() if not line.startswith(" ")] == ["one", "two"]
    assert len(words.stdout.splitlines()) == 12

    def ids(*arguments: str) -> list[tuple[str, list[str]]]:
        found = json.loads(_lockstep(directory, "episodes", *arguments, "--json").stdout)
        return [(each["info"]["id"], [episode["id"] for episode in each["episodes"]]) for each in found]

    assert ids("--only-state", "kept", "--only-state", "cut") == [("one", ["a", "c", "d"]), ("two", ["a", "c", "d"])]
    assert ids("--only-outcome", "success") == [("one", ["a"]), ("two", ["a", "c"])]
    assert ids("--only-task", "wipe", "--only-outcome", "success") == [("two", ["c"])]
    assert ids("--only-outcome", "none", "--only-state", "open", "--only-without-problems") == [
        ("one", ["e"]),
        ("two", ["e"]),
    ]
    assert ids("--only-driver", "Nobody") == []
    for file in ((), ("one",)):
        assert (
            "no episode that was asked for in" in _lockstep(directory, "episodes", *file, "--only-driver", "x").stderr
        )
    one = json.loads(_lockstep(directory, "episodes", "one", "--only-task", "wipe", "--json").stdout)
    assert [each["id"] for each in one] == ["c"]


def test_a_choice_does_not_say_which_episode_to_change(directory: Path) -> None:
    for arguments, words in (
        (("one", "--edit", "a", "--only-task", "wipe", "--task", "x"), "--edit names the one to change"),
        (("--edit", "a", "--task", "x"), "name the recording"),
        (("--changes",), "name the recording"),
        (("--after", "1"), "name the recording"),
        (("one", "--after", "1"), "--after goes with a change"),
        (("one", "--changes", "--only-task", "x"), "--only-… chooses the episodes that are listed"),
    ):
        found = _lockstep(directory, "episodes", *arguments)
        assert (found.exit_code, words in found.stderr) == (2, True), found.stderr
    assert not list(directory.glob("*.jsonl"))


def test_a_dataset_is_made_of_the_chosen_episodes_and_keeps_its_options(directory: Path, tmp_path: Path) -> None:
    command = ("export", "one", "two", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    done = _lockstep(directory, *command, "--append", "--only-outcome", "failure")
    assert done.exit_code == 0, done.output
    assert "episode a of one.mcap is left out: its outcome is success" in done.stdout
    assert _lockstep(directory, "verify", str(tmp_path / "dataset")).stdout.startswith("1 episodes, 15 rows")
    for arguments, words in (
        (("--append", "--tolerance", "2"), "a tolerance of 4 and not 2 events"),
        (("--follow", "--fps", "10"), "each event as a row and not 10 rows a second"),
        (("--append", "--only-outcome", "success"), "not those that --only-… chooses now"),
    ):
        found = _lockstep(directory, *command, *arguments)
        assert (found.exit_code, words in found.stderr) == (2, True), found.output
    assert _lockstep(directory, *command, "--append").exit_code == 0
    found = _lockstep(directory, "export", "one", "--to", "csv", "--only-task", "push")
    assert (found.exit_code, "are for lerobot alone" in found.stderr) == (2, True), found.stderr


def test_an_episode_is_split_its_parts_are_changed_and_all_of_it_is_taken_back(directory: Path) -> None:
    def ids(*arguments: str) -> list[tuple[str, int, int, str]]:
        found = json.loads(_lockstep(directory, "episodes", "one", *arguments, "--json").stdout)
        return [(each["id"], each["first_event"], each["last_event"], each["state"]) for each in found][:2]

    assert ids("--edit", "a", "--split", "15") == [("edit-1a", 10, 15, "kept"), ("edit-1b", 15, 20, "kept")]
    assert ids("--edit", "edit-1b", "--drop")[1] == ("edit-1b", 15, 20, "discarded")
    assert ids("--undo", "2")[1][3] == "kept"
    assert ids("--edit", "edit-1a", "--merge", "edit-1b")[0] == ("edit-4", 10, 20, "kept")
    words = _lockstep(directory, "episodes", "one", "--changes").stdout
    assert [line.split()[0] for line in words.splitlines()] == ["1", "2", "3", "4"]
    assert "command line" in words
    assert words.splitlines()[1].endswith("discarded  undone")


def test_a_stale_change_is_refused_and_so_is_a_number_that_several_have(directory: Path) -> None:
    assert _lockstep(directory, "episodes", "one", "--edit", "a", "--task", "x", "--after", "0").exit_code == 0
    for arguments, words in (
        (("--edit", "a", "--task", "y", "--after", "0"), "there are 1 changes by now"),
        (("--edit", "1", "--task", "y"), "several episodes have the number 1"),
        (("--task", "y"), "--edit names the episode"),
        (("--undo", "7"), "no change 7"),
    ):
        found = _lockstep(directory, "episodes", "one", *arguments)
        assert (found.exit_code, words in found.stderr) == (2, True), found.stderr


def test_a_dataset_is_verified_and_never_written_over_another(directory: Path, tmp_path: Path) -> None:
    command = ("export", "one", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    done = _lockstep(directory, *command)
    assert done.exit_code == 0, done.output
    verdict = _lockstep(directory, "verify", str(tmp_path / "dataset"))
    assert verdict.exit_code == 0, verdict.output
    assert verdict.stdout.startswith("2 episodes, 25 rows, tolerance 4 events\n")
    assert verdict.stdout.endswith("\n--    shown (not looked at: --pixels)\n")
    verdict = _lockstep(directory, "verify", str(tmp_path / "dataset"), "--pixels")
    assert verdict.stdout.endswith("\n--    shown (not looked at: no event is drawn into the pictures)\n")
    again = _lockstep(directory, *command)
    assert (again.exit_code, "already" in again.stderr) == (2, True)


def test_a_kept_episode_that_has_no_row_is_said_by_name(directory: Path, tmp_path: Path) -> None:
    recording(directory / "three.mcap", episode("x", "start", 1, 1), episode("x", "kept", 1, 2))
    done = _lockstep(directory, "export", "one", "three", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    assert done.exit_code == 0, done.output
    first, last = done.stdout.splitlines()
    assert first.startswith("episode x of three.mcap is left out: no event has ")
    assert last == str(tmp_path / "dataset")


def test_a_file_without_episodes_beside_others_is_left_out_by_name_and_whole_takes_it(
    directory: Path, tmp_path: Path
) -> None:
    recording(directory / "three.mcap")
    command = ("export", "three", "one", "--to", "lerobot", "--out")
    done = _lockstep(directory, *command, str(tmp_path / "dataset"))
    assert done.exit_code == 0, done.output
    first, last = done.stdout.splitlines()
    assert first.startswith("three.mcap is left out: it has no episodes, and its recording was made by episodes, as ")
    assert last == str(tmp_path / "dataset")
    alone = _lockstep(directory, "export", "three", "--to", "lerobot", "--out", str(tmp_path / "none"))
    assert (alone.exit_code, "--whole takes it" in alone.stderr) == (2, True), alone.output
    appended = _lockstep(
        directory, "export", "three", "--to", "lerobot", "--append", "--out", str(tmp_path / "dataset")
    )
    assert appended.stdout.splitlines()[1:] == ["0 appended, 1 left out", str(tmp_path / "dataset")]
    whole = _lockstep(directory, *command, str(tmp_path / "whole"), "--whole")
    assert whole.stdout.startswith("three.mcap has no episodes and is one as a whole, with the task ")
    follow = _lockstep(directory, "export", "--to", "lerobot", "--follow", "--whole", "--out", str(tmp_path / "x"))
    assert (follow.exit_code, "kept episodes alone" in follow.stderr) == (2, True)


def test_verify_names_the_episodes_of_a_dataset_that_were_discarded_since(directory: Path, tmp_path: Path) -> None:
    (directory / "two.mcap").unlink()  # a copy
    done = _lockstep(directory, "export", "one", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    assert done.exit_code == 0, done.output
    command = ("verify", str(tmp_path / "dataset"), "--recordings", str(directory))
    assert "ok    current (2 looked at)" in _lockstep(directory, *command).stdout
    assert _lockstep(directory, "episodes", "one", "--edit", "a", "--drop").exit_code == 0
    verdict = _lockstep(directory, *command)
    assert verdict.exit_code == 1
    assert f"FAIL  current (2 looked at)\n        episode a of {INFO.recording} is discarded\n" in verdict.stdout
    assert "current (not looked at: --recordings FOLDER)" in _lockstep(directory, *command[:2]).stdout


def test_a_copy_of_a_recording_comes_into_a_dataset_once(directory: Path, tmp_path: Path) -> None:
    """No event of a recording comes into a dataset twice: what the copy has is left out by name."""
    done = _lockstep(directory, "export", "one", "two", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    assert done.exit_code == 0, done.output
    assert done.stdout.count("of two.mcap is left out: the dataset has it already\n") == 2
    verdict = json.loads(_lockstep(directory, "verify", str(tmp_path / "dataset"), "--json").stdout)
    assert (verdict["ok"], verdict["episodes"], verdict["rows"]) == (True, 2, 25)


def test_the_check_says_that_two_recordings_are_of_the_same_events(directory: Path, tmp_path: Path) -> None:
    """As when somebody has written a copy under another id."""
    (directory / "two.mcap").unlink()
    recording(directory / "two.mcap", *KEPT_AND_NOT, info=OTHER)
    done = _lockstep(directory, "export", "one", "two", "--to", "lerobot", "--out", str(tmp_path / "dataset"))
    assert done.exit_code == 0, done.output
    verdict = json.loads(_lockstep(directory, "verify", str(tmp_path / "dataset"), "--json").stdout)
    assert (verdict["ok"], verdict["episodes"], verdict["rows"]) == (False, 4, 50)
    assert {name for name, check in verdict["checks"].items() if check["count"]} == {"ordered"}
