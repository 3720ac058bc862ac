"""`lockstep recordings`, `verify`, `export`, `report` and `record`, as their users call them."""

import json
import os
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from mcap.reader import SeekingReader
from typer.testing import CliRunner, Result

from lockstep.server.cli.main import app
from lockstep.server.evidence.signer import Signer
from lockstep.server.recording.export.unfinished import LOCK
from lockstep.server.recording.format.signature import RecordingSigning
from tests.server.recording.makers import Story

EVENTS = 60


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Where recordings are; one is there."""
    found = tmp_path / "recordings"
    found.mkdir()
    Story(events=EVENTS, real=True).write(found / "one.mcap")
    return found


def _lockstep(directory: Path, *arguments: str) -> Result:
    environment = {
        "LOCKSTEP_STATE_DIR": str(directory.parent / "state"),
        "LOCKSTEP_RECORDING__DIRECTORY": str(directory),
        "LOCKSTEP_PUBLIC_URL": "",
    }
    return CliRunner().invoke(app, arguments, env=environment)


def test_recordings_are_listed_in_words_and_as_json(directory: Path) -> None:
    words = _lockstep(directory, "recordings")
    assert words.exit_code == 0, words.output
    assert words.stdout.startswith("one ")
    assert f"s=1–{EVENTS}" in words.stdout
    assert "Planar robot  first" in words.stdout
    (entry,) = json.loads(_lockstep(directory, "recordings", "--json").stdout)
    assert (entry["id"], entry["last_event"], entry["interrupted"]) == ("one", EVENTS, False)
    assert json.loads(_lockstep(directory, "recordings", "--json", "--dir", str(directory.parent)).stdout) == []


def test_where_no_recording_is_there_the_command_says_where_it_looked(directory: Path) -> None:
    empty, nowhere = directory.parent / "empty", directory.parent / "nowhere"
    empty.mkdir()
    for where, said in ((empty, f"no complete recording in {empty}"), (nowhere, f"there is no directory {nowhere}")):
        found = _lockstep(directory, "recordings", "--dir", str(where))
        assert (found.exit_code, found.stdout) == (0, "")
        assert found.stderr.strip().endswith(said)


def test_a_recording_is_verified_by_its_id_or_its_path(directory: Path) -> None:
    words = _lockstep(directory, "verify", "one")
    assert words.exit_code == 0, words.output
    assert words.stdout.startswith(f"{EVENTS - 1} commands, {EVENTS - 1} events")
    assert "FAIL" not in words.stdout
    found = json.loads(_lockstep(directory, "verify", str(directory / "one.mcap"), "--json").stdout)
    assert all(check["count"] == 0 for check in found["checks"].values())


def test_several_are_verified_each_under_its_name_whatever_the_others_are_like(directory: Path) -> None:
    Story(events=EVENTS).write(directory / "two.mcap")
    (directory / "text.mcap").write_text("no recording")
    good = _lockstep(directory, "verify", "one", "two")
    assert good.exit_code == 0, good.output
    assert [line for line in good.stdout.splitlines() if line in ("one", "two")] == ["one", "two"]
    found = _lockstep(directory, "verify", "text", "one", "--json")
    assert found.exit_code == 2, "the worst of all"
    (line,) = found.stdout.splitlines()
    assert json.loads(line)["file"].endswith("one.mcap")


def test_who_signed_it_is_said_and_a_key_that_did_not_is_named(directory: Path) -> None:
    signer = Signer(Ed25519PrivateKey.generate())
    Story(events=EVENTS).write(directory / "two.mcap", signing=RecordingSigning(signer, lambda: ""))
    good = _lockstep(directory, "verify", "two", "--key", signer.public_key)
    assert good.exit_code == 0, good.output
    assert f"up to s={EVENTS}" in good.stdout
    assert f"by {signer.public_key}" in good.stdout
    assert _lockstep(directory, "verify", "two", "--key", "0" * 64).exit_code == 1
    assert _lockstep(directory, "verify", "two", "--key", "key").exit_code == 2
    unsigned = _lockstep(directory, "verify", "one")
    assert unsigned.exit_code == 0
    assert "unsigned" in unsigned.stdout
    assert _lockstep(directory, "verify", "one", "--key", signer.public_key).exit_code == 1


def test_a_tampered_recording_ends_with_1_and_what_is_none_with_2(directory: Path) -> None:
    path = directory / "one.mcap"
    with path.open("rb") as file:
        summary = SeekingReader(file).get_summary()
    assert summary is not None
    first = summary.chunk_indexes[0]
    data = bytearray(path.read_bytes())
    data[first.chunk_start_offset + first.chunk_length // 2] ^= 1
    path.write_bytes(data)
    verdict = _lockstep(directory, "verify", "one")
    assert verdict.exit_code == 1
    assert "FAIL  readable" in verdict.stdout
    (directory / "text.mcap").write_text("no recording")
    assert _lockstep(directory, "verify", "text").exit_code == 2
    missing = _lockstep(directory, "verify", "nowhere")
    assert missing.exit_code == 2
    assert "there is no recording nowhere" in missing.stderr


@pytest.mark.parametrize(
    ("kind", "written"),
    [
        ("mp4", "one-front.mp4"),
        ("csv", "one.csv"),
        ("parquet", "one.parquet"),
        ("rerun", "one.rrd"),
        ("rosbag2", "one-rosbag2"),
    ],
)
def test_an_export_says_what_it_wrote_beside_the_recording(directory: Path, kind: str, written: str) -> None:
    done = _lockstep(directory, "export", "one", "--to", kind)
    assert done.exit_code == 0, done.output
    assert done.stdout.split() == [str(directory / written)]
    assert (directory / written).stat().st_size > 0


def test_an_export_leaves_out_what_is_of_no_kept_episode_if_asked_to(directory: Path) -> None:
    done = _lockstep(directory, "export", "one", "--to", "csv", "--kept")
    assert done.exit_code == 0, done.output
    assert len((directory / "one.csv").read_text().splitlines()) == 1, "without an episode only the head is left"
    for other in ("mp4", "lerobot"):
        refused = _lockstep(directory, "export", "one", "--to", other, "--kept")
        assert refused.exit_code == 2
        assert "--kept is for csv, parquet, rerun and rosbag2" in refused.stderr


def test_a_dataset_goes_where_it_is_told(directory: Path, tmp_path: Path) -> None:
    out = tmp_path / "dataset"
    done = _lockstep(directory, "export", "one", "--to", "lerobot", "--out", str(out), "--task", "push")
    assert done.exit_code == 0, done.output
    assert (out / "meta" / "info.json").is_file()


def test_a_report_is_drawn_of_an_id_as_of_a_path(directory: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    done = _lockstep(directory, "report", "one", "--out", str(out))
    assert done.exit_code == 0, done.output
    assert "<svg" in out.read_text(encoding="utf-8")
    assert _lockstep(directory, "report", "nowhere").exit_code == 2


def test_what_cannot_be_exported_is_said_in_one_line(directory: Path) -> None:
    (directory / "text.mcap").write_text("no recording")
    done = _lockstep(directory, "export", "text", "--to", "csv")
    assert done.exit_code == 2
    assert "lockstep: text.mcap is not an MCAP file" in done.stderr
    assert "Traceback" not in done.output


def test_what_cannot_be_replayed_is_said_before_anything_is_served(directory: Path) -> None:
    (directory / "text.mcap").write_text("no recording")
    done = _lockstep(directory, "replay", "text")
    assert done.exit_code == 2
    assert "lockstep: text.mcap is not an MCAP file" in done.stderr


def test_without_a_console_recording_says_that_none_runs(directory: Path) -> None:
    done = _lockstep(directory, "record", "start")
    assert done.exit_code == 2
    assert "no console has run with this state directory" in done.stderr


@pytest.mark.parametrize("command", [["verify"], ["verify", "--json"], ["export", "--to", "csv"], ["replay"]])
def test_the_name_of_a_file_writes_no_line_of_its_own_and_commands_no_terminal(
    directory: Path, command: list[str]
) -> None:
    name = os.fsdecode(b"\x1b[2J\xff\nok    forged")
    (directory / f"{name}.mcap").write_text("no recording")
    bad = _lockstep(directory, *command, str(directory / f"{name}.mcap"))
    assert bad.exit_code == 2
    assert "\\x1b[2J" in bad.stderr, "it is shown, as what it is"
    if command != ["replay"]:  # which goes on until it is ended
        (directory / "one.mcap").rename(directory / f"{name}.mcap")
        good = _lockstep(directory, *command, str(directory / f"{name}.mcap"))
        assert good.exit_code == 0, good.output
        bad = good
    assert "\x1b" not in bad.output
    assert not any(line.startswith("ok    forged") for line in bad.output.splitlines())


def test_what_killed_exports_left_is_named_and_removed_on_demand(directory: Path) -> None:
    left = directory / ".one.lerobot.partial-ab12"
    left.mkdir()
    (left / LOCK).touch()
    assert "--clean" in _lockstep(directory, "recordings").output
    assert _lockstep(directory, "recordings", "--clean").stdout == f"{left}\n"
    assert not left.exists()
    assert _lockstep(directory, "recordings").output.startswith("one ")
