"""The commands about recordings: `record`, `recordings`, `replay`, `verify`, `report`."""

import os
import sys
from collections.abc import Callable
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from lockstep.protocol.console import RecordingState
from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.console_request import ask_console, read_answer
from lockstep.server.cli.extras import load_extra
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.evidence.anchors import parse_anchor
from lockstep.server.evidence.signer import is_public_key
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.export.unfinished import remove_stale, stale_folders
from lockstep.server.recording.recording_store import RecordingEntry, RecordingStore
from lockstep.server.recording.settings import recordings_directory
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.recording.verify.verify_signature import SignatureReport
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import ConsoleState, open_state, robot_directory
from lockstep.server.util.display_names import escaped, printable
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = [
    "EXTRA_OF",
    "DirectoryOption",
    "ExportFormat",
    "File",
    "add_recording_commands",
    "or_usage",
    "recording_file",
    "recording_store",
    "usage_error",
]

EXIT_BROKEN = 1  # a promise is not kept
EXIT_USAGE = 2
NO_PIXELS = "not looked at: --pixels"
NO_RECORDINGS = "not looked at: --recordings FOLDER"
NO_STRIP = "not looked at: no event is drawn into the pictures"

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
File = Annotated[Path, typer.Argument(help="A recording: its file, or its id in the recordings' directory.")]
DirectoryOption = Annotated[
    Path | None, typer.Option("--dir", help="The recordings' directory. Unset: the one in the console's settings.")
]


class _Recordings(msgspec.Struct):
    """The part of the answer of GET /api/recordings that is needed here."""

    state: dict[str, Any]


class ExportFormat(StrEnum):
    MP4 = "mp4"
    CSV = "csv"
    PARQUET = "parquet"
    LEROBOT = "lerobot"
    RERUN = "rerun"
    ROSBAG2 = "rosbag2"


# The extra that each needs; the others need "export", or none.
EXTRA_OF = {ExportFormat.RERUN: "rerun", ExportFormat.ROSBAG2: "rosbag2"}


def add_recording_commands(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the commands. `make_settings` turns flags into settings, as for the other commands."""
    record = typer.Typer(no_args_is_help=True, help="Start and end the recording of a running console.")
    app.add_typer(record, name="record")

    @record.command("start")
    def record_start(
        name: Annotated[str, typer.Option(help="The recording's name in the list.")] = "",
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Start to record."""
        _say_state(
            ask_console(make_settings(state_dir=state_dir), robot, "POST", "/api/recordings", {"name": name}), as_json
        )

    @record.command("stop")
    def record_stop(robot: RobotOption = "", state_dir: StateDirOption = None, as_json: Json = False) -> None:
        """End the recording; returns when the file is closed."""
        _say_state(ask_console(make_settings(state_dir=state_dir), robot, "POST", "/api/recordings/stop"), as_json)

    @record.command("status")
    def record_status(robot: RobotOption = "", state_dir: StateDirOption = None, as_json: Json = False) -> None:
        """Say whether the session is recorded."""
        found = ask_console(make_settings(state_dir=state_dir), robot, "GET", "/api/recordings")
        _say_state(read_answer(_Recordings, found).state, as_json)

    @app.command()
    def recordings(
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        clean: Annotated[
            bool, typer.Option("--clean", help="Remove what killed exports have left in the directory instead.")
        ] = False,
        as_json: Json = False,
    ) -> None:
        """List the recordings that are complete."""
        store = recording_store(make_settings(state_dir=state_dir), robot, directory)
        if clean:
            for path in or_usage(lambda: remove_stale(store.directory)):
                sys.stdout.write(f"{escaped(path)}\n")
            return
        found = store.entries()
        left = len(stale_folders(store.directory)) if store.directory.is_dir() else 0
        if left:
            _say(f"{left} exports were killed and left folders here: lockstep recordings --clean removes them")
        if as_json:
            sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
            return
        for entry in found:
            sys.stdout.write(_line(entry) + "\n")
        if not found:
            none = "no complete recording in" if store.directory.is_dir() else "there is no directory"
            _say(f"{none} {escaped(store.directory)}")

    @app.command()
    def replay(
        file: Annotated[Path, typer.Argument(help="A recording: its file, or its id; with --to also a dataset.")],
        host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
        port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free port.")] = 0,
        to: Annotated[str, typer.Option(help="Drive the robot behind this operator's link along it instead.")] = "",
        episode: Annotated[int, typer.Option(min=0, help="--to: the kept episode, counted from 0.")] = 0,
        whole: Annotated[
            bool, typer.Option("--whole", help="--to: take a file without episodes as one in any case.")
        ] = False,
        pace: Annotated[float, typer.Option(min=0.05, max=1.0, help="--to: 1 is as it was recorded.")] = 1.0,
        from_anywhere: Annotated[
            bool, typer.Option("--from-anywhere", help="--to: go to the beginning, however far it is.")
        ] = False,
        tls_ca: Annotated[Path | None, typer.Option(help="--to: a certificate to trust.")] = None,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Serve the player for one recording, without a robot, and print its link; or drive a robot along it (--to)."""
        is_dataset = (file / "meta" / "info.json").is_file()
        path = file if is_dataset else recording_file(file, make_settings(state_dir=state_dir), robot, directory)
        if to:
            from lockstep.server.cli.recordings.replay_to import replay_to

            replay_to(
                path,
                to,
                episode,
                pace,
                whole=whole,
                from_anywhere=from_anywhere,
                tls_ca=tls_ca,
                as_json=as_json,
            )
            return
        if is_dataset:
            raise usage_error("the player takes recordings alone; --to LINK drives a robot along a dataset")
        from lockstep.server.cli.recordings.replay import serve_replay

        serve_replay(path, host, port, as_json)

    @app.command()
    def verify(
        files: Annotated[list[Path], typer.Argument(help="Recordings, by file or id in the directory; or datasets.")],
        key: Annotated[
            str,
            typer.Option(help="The public key that must have signed the recording. Unset: any key, or no signature."),
        ] = "",
        pixels: Annotated[bool, typer.Option(help="Datasets: read the events that --event-strip has drawn.")] = False,
        recordings: Annotated[
            Path | None,
            typer.Option(help="Datasets: the folder of their recordings, to find episodes that have changed since."),
        ] = None,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Check what is promised against recordings or datasets. Exit code 1: it is not kept; 2: one cannot be read."""
        if key and not is_public_key(key):
            raise usage_error("a public key has 64 hexadecimal digits")

        def is_kept(file: Path) -> bool:
            if (file / "meta" / "info.json").is_file():
                return _verify_dataset(file, as_json, pixels, recordings)
            return _verify_file(
                recording_file(file, make_settings(state_dir=state_dir), robot, directory), key, as_json
            )

        worst = 0
        for file in files:  # each of them, whatever the one before was like
            if len(files) > 1 and not as_json:
                sys.stdout.write(f"{escaped(file)}\n")
            try:
                worst = max(worst, 0 if is_kept(file) else EXIT_BROKEN)
            except typer.Exit as error:
                worst = max(worst, error.exit_code)
        raise typer.Exit(worst)

    @app.command()
    def report(
        file: File,
        out: Annotated[
            Path | None, typer.Option("--out", "--html", help="HTML file to write; unset: beside the recording.")
        ] = None,
        alone: Annotated[
            bool, typer.Option("--alone", help="This file alone, not all files of the session that it begins.")
        ] = False,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
    ) -> None:
        """Write what was kept, lost and refused in a recording or dataset, by driver and camera, as one HTML file."""
        if (file / "meta" / "info.json").is_file():
            pages: Any = load_extra("lockstep.server.recording.report.dataset_page", "export")  # needs pyarrow
            target = out or file.with_name(f"{file.resolve().name}.html")
            or_usage(lambda: target.write_text(pages.dataset_page(file), encoding="utf-8"))
            sys.stdout.write(f"{escaped(target)}\n")
            return
        path = recording_file(file, make_settings(state_dir=state_dir), robot, directory)
        reporter: Any = load_extra("lockstep.server.recording.report.report", "report")  # needs matplotlib
        written = or_usage(lambda: reporter.write_report(path, out or path.with_suffix(".html"), alone=alone))
        sys.stdout.write(f"{escaped(written)}\n")


def _verify_file(path: Path, key: str, as_json: bool) -> bool:
    verdict = or_usage(lambda: verify_file(path, key))
    if as_json:
        told = os.fsencode(path).decode(errors="replace")
        sys.stdout.write(msgspec.json.encode({"file": told, **msgspec.to_builtins(verdict)}).decode() + "\n")
    else:
        sys.stdout.write(_in_words(verdict))
    return bool(verdict.ok)


def _verify_dataset(root: Path, as_json: bool, pixels: bool, recordings: Path | None) -> bool:
    verifier: Any = load_extra("lockstep.server.recording.verify.verify_dataset", "export")  # needs pyarrow
    verdict = or_usage(lambda: verifier.verify_dataset(root, pixels=pixels, recordings=recordings))
    if as_json:
        sys.stdout.write(msgspec.json.encode(verdict).decode() + "\n")
    else:
        lines = [f"{verdict.episodes} episodes, {verdict.rows} rows, tolerance {verdict.tolerance} events"]
        for name, check in verdict.checks.items():
            if name == "shown" and not check.looked:
                lines.append(f"--    shown ({NO_STRIP if pixels else NO_PIXELS})")
                continue
            if name == "current" and recordings is None:
                lines.append(f"--    current ({NO_RECORDINGS})")
                continue
            lines.append(f"{'ok  ' if check.ok else 'FAIL'}  {name} ({check.looked} looked at)")
            named = check.violations if name == "current" else check.violations[:5]  # each episode is to be named
            lines += [f"        {_row(each.row)}{printable(each.text)}" for each in named]
            if check.count > len(named):
                lines.append(f"        and {check.count - len(named)} more")
        sys.stdout.write("\n".join(lines) + "\n")
    return bool(verdict.ok)


def _row(number: int) -> str:
    return f"row {number}: " if number >= 0 else ""


def _say_state(answer: dict[str, Any], as_json: bool) -> None:
    state = read_answer(RecordingState, answer)
    if as_json:
        sys.stdout.write(msgspec.json.encode(answer).decode() + "\n")
        return
    words = {"off": "not recording", "failed": f"failed: {printable(state.detail)}"}
    running = f"recording {printable(state.recording)}, {state.bytes / 1e6:.1f} MB"
    sys.stdout.write(words.get(state.state, running) + "\n")


def _state(settings: Settings) -> ConsoleState:
    try:
        return open_state(settings)
    except StateDirUnusable as error:
        raise usage_error(str(error)) from error


def recording_store(settings: Settings, robot: str, directory: Path | None) -> RecordingStore:
    """Return the directory of recordings: `directory`, or that of the console's settings."""
    own = recordings_directory(settings.recording, robot_directory(settings, robot))
    if robot and settings.recording.directory is not None:
        own /= robot  # as the console does
    return RecordingStore(directory or own, settings.recording)


def recording_file(file: Path, settings: Settings, robot: str, directory: Path | None) -> Path:
    """Return `file` itself, or the recording of that id."""
    if file.is_file():
        return file
    found = recording_store(settings, robot, directory).path(file.name)
    if found is None:
        raise usage_error(f"there is no recording {file}")
    return found


def or_usage(work: Callable[[], Any]) -> Any:
    """Return what `work` returns; an error of a recording or of the disk ends the command with one line."""
    try:
        return work()
    except (RecordingError, OSError, ImportError) as error:
        raise usage_error(str(error)) from error


def _line(entry: RecordingEntry) -> str:
    began = datetime.fromtimestamp(entry.started / 1e6).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    seconds = (entry.ended - entry.started) / 1e6
    events = f"s={entry.first_event}–{entry.last_event}"
    interrupted = "  interrupted" if entry.interrupted else ""
    size = f"{entry.bytes / 1e6:.1f} MB"
    return (
        f"{printable(entry.id):28}  {began}  {seconds:7.1f} s  {events:18}  {size:>10}"
        f"  {printable(entry.robot)}  {printable(entry.name)}{interrupted}"
    )


def _in_words(verdict: Verdict) -> str:
    """Return the verdict in words. Names and topics are from the file: unescaped, they could fake a verdict."""
    lines = [f"{verdict.commands} commands, {verdict.events} events, {verdict.pictures_and_sounds} pictures and sounds"]
    for name, check in verdict.checks.items():
        looked = f" ({check.looked} looked at)" if check.looked else ""
        lines.append(f"{'ok  ' if check.ok else 'FAIL'}  {name}{looked}{'' if check.ok else f': {check.count} times'}")
        lines += [f"        s={each.event}: {printable(each.text)}" for each in check.violations[:5]]
    return "\n".join([*lines, *_signature_words(verdict.signature)]) + "\n"


def _signature_words(report: SignatureReport) -> list[str]:
    if report.state == "unsigned":
        return ["unsigned: anyone who can write the file can change it so that these checks still pass"]
    until = datetime.fromtimestamp(report.until_time / 1e6).astimezone().isoformat(timespec="milliseconds")
    lines = [f"{report.state}: {report.signatures} signatures, the last one up to s={report.until_event}, {until}"]
    if report.signer:
        lines.append(f"        by {printable(report.signer)}")
    anchor = parse_anchor(report.audit)
    if anchor is not None:
        log, head = printable(anchor.log), printable(anchor.head)
        lines.append(f"        with a signed head of the audit {log}: record {anchor.n}, {head}")
    return lines


def usage_error(text: str) -> typer.Exit:
    """Say what is wrong, and return what ends the command."""
    _say(text)
    return typer.Exit(EXIT_USAGE)


def _say(text: str) -> None:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
