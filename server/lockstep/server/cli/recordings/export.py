"""The command `export`: writes recordings in another form, or follows them into a dataset."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.extras import load_extra
from lockstep.server.cli.option_group import with_options
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.cli.recordings.choosing import EpisodeChoice
from lockstep.server.cli.recordings.recordings import (
    EXTRA_OF,
    DirectoryOption,
    ExportFormat,
    or_usage,
    recording_file,
    recording_store,
    usage_error,
)
from lockstep.server.util.display_names import escaped, printable

__all__ = ["add_export_command"]

EXTRAS = ("wrench", "ranges")
DATASET = "lerobot: "
HAVE_KEPT = (ExportFormat.CSV, ExportFormat.PARQUET, ExportFormat.RERUN, ExportFormat.ROSBAG2)


def add_export_command(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the command. `make_settings` turns flags into settings, as for the other commands."""

    @app.command()
    @with_options(EpisodeChoice)
    def export(
        to: Annotated[
            ExportFormat, typer.Option(help="mp4: pictures and sound; csv, parquet: tables; others: for these tools.")
        ],
        files: Annotated[list[Path] | None, typer.Argument(help="Recordings: their files, or their ids.")] = None,
        out: Annotated[
            Path | None, typer.Option(help="File or directory to write. Unset: beside the recording.")
        ] = None,
        task: Annotated[str, typer.Option(help=DATASET + "the task of recordings without episodes, in words.")] = "",
        tolerance: Annotated[
            int | None,
            typer.Option(min=0, help=DATASET + "events by which a picture may be older than its row. Unset: 4."),
        ] = None,
        fps: Annotated[
            int | None, typer.Option(min=1, max=1000, help=DATASET + "rows per second. Unset: each event is a row.")
        ] = None,
        axes: Annotated[
            str, typer.Option(help=DATASET + "axes of the action, with commas. Unset: all but poses.")
        ] = "",
        state: Annotated[str, typer.Option(help=DATASET + "joints and axes of the state, with commas.")] = "",
        cameras: Annotated[str, typer.Option(help=DATASET + "cameras, with commas. Unset: all.")] = "",
        extra: Annotated[
            list[str] | None, typer.Option("--with", help=DATASET + "wrench or ranges, as a column of its own.")
        ] = None,
        whole: Annotated[
            bool,
            typer.Option("--whole", help=DATASET + "take each file without episodes as one in any case."),
        ] = False,
        kept: Annotated[
            bool, typer.Option("--kept", help="csv, parquet, rerun, rosbag2: only what was driven in kept episodes.")
        ] = False,
        append: Annotated[bool, typer.Option("--append", help=DATASET + "append what the dataset has not.")] = False,
        follow: Annotated[
            bool,
            typer.Option("--follow", help=DATASET + "append each kept episode when it is on the disk, until ended."),
        ] = False,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        *,
        options: EpisodeChoice,
    ) -> None:
        """Write recordings in another form; lerobot: the kept episodes of all of them as one dataset."""
        settings = make_settings(state_dir=state_dir)
        paths = [recording_file(file, settings, robot, directory) for file in files or []]
        if kept and to not in HAVE_KEPT:
            raise usage_error("--kept is for csv, parquet, rerun and rosbag2; lerobot has kept episodes alone")
        only = options.filter()
        if to is ExportFormat.LEROBOT:
            store = recording_store(settings, robot, directory)
            chosen = _options(
                task=task,
                whole=whole,
                tolerance=tolerance,
                fps=fps,
                cameras=_words(cameras),
                layout={"axes": _words(axes), "state": _words(state), "extras": extra or []},
                only=msgspec.to_builtins(only),
            )
            _export_dataset(paths, store.files, out, chosen, append=append, follow=follow)
            return
        if follow or append or only:
            raise usage_error("--append, --follow and --only-… are for lerobot alone")
        if not paths:
            raise usage_error("name a recording")
        if out is not None and len(paths) > 1:
            raise usage_error("--out takes one recording at a time, but for lerobot")
        # Loaded only here: what needs no extra takes none.
        exporter: Any = load_extra(f"lockstep.server.recording.export.export_{to.value}", EXTRA_OF.get(to, "export"))
        further = {"kept": True} if kept else {}
        for path in paths:
            for each in or_usage(partial(exporter.export, path, out, task, **further)):
                _say(escaped(each))


def _export_dataset(
    paths: list[Path], files: Any, out: Path | None, options: Any, *, append: bool, follow: bool
) -> None:
    following: Any = load_extra("lockstep.server.cli.recordings.follow", "export")
    exporter: Any = load_extra("lockstep.server.recording.export.export_lerobot", "export")
    if (append or follow) and out is None:
        raise usage_error("--append and --follow need --out")
    if follow and options.whole:
        raise usage_error("--follow takes kept episodes alone; take --append for --whole")
    if follow:
        begun = f"{escaped(out)} follows {escaped(', '.join(map(str, paths)) or 'the recordings')}"
        wanted = (lambda: paths) if paths else files
        or_usage(lambda: following.follow(wanted, out, options, _say_printable, all_of=bool(paths), begun=begun))
        return
    if not paths:
        raise usage_error("name a recording")
    if append:
        or_usage(lambda: following.append_once(paths, out, options, _say_printable))
        _say(escaped(out))
        return
    for each in or_usage(lambda: exporter.export_all(paths, out, options, say=_say_printable)):
        _say(escaped(each))


def _options(**chosen: Any) -> Any:
    """Return the dataset's options; a wrong one ends the command."""
    exporter: Any = load_extra("lockstep.server.recording.export.export_lerobot", "export")
    wrong = [each for each in chosen["layout"]["extras"] if each not in EXTRAS]
    if wrong:
        raise usage_error(f"--with takes {' or '.join(EXTRAS)}, not {', '.join(wrong)}")
    return exporter.options_of(chosen)


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _say_printable(text: str) -> None:
    _say(printable(text))


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
