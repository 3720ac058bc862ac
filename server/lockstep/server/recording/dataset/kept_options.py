"""A dataset keeps the options that it was made with: others that somebody names for it are refused. No I/O."""

from collections.abc import Iterator, Sequence
from typing import Any

from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.export.lerobot_meta import DatasetNotes
from lockstep.server.recording.format.topics import CAMERA

__all__ = ["check_options"]

EACH_EVENT = "each event as a row"
ALL = "all"


def check_options(name: str, options: DatasetOptions, notes: DatasetNotes, info: dict[str, Any]) -> None:
    """Refuse options that differ from those of a dataset. One that is unset differs from nothing.

    Args:
        name: of the dataset, for the words
        info: its meta/info.json; empty: it has no episode

    Raises:
        DatasetRefused: they differ; it says all that do.
    """
    wrong = list(_differences(options, notes, info))
    if wrong:
        raise DatasetRefused(
            f"{name} keeps what it was made with, {'; '.join(wrong)}: leave these options out, or name another --out"
        )


def _differences(options: DatasetOptions, notes: DatasetNotes, info: dict[str, Any]) -> Iterator[str]:
    """Yield in words what differs."""
    if options.tolerance not in (None, notes.tolerance):
        yield f"a tolerance of {notes.tolerance} and not {options.tolerance} events"
    fps = info.get("fps", notes.fps) if notes.has_rate else None  # rows are made at a rate that somebody chose
    if options.fps not in (None, fps):
        yield f"{EACH_EVENT if fps is None else f'{fps} rows a second'} and not {options.fps} rows a second"
    cameras = [topic.removeprefix(CAMERA) for topic in notes.topics]
    if options.cameras and sorted(options.cameras) != sorted(cameras):
        yield f"the cameras {_listed(cameras)} and not {_listed(options.cameras)}"
    columns = (
        ("axes", "action", options.layout.axes, notes.layout.axes),
        ("state", "observation.state", options.layout.state, notes.layout.state),
    )
    for word, column, wanted, chosen in columns:
        there = _names_in(info, column) or chosen
        if wanted and not _are_same(wanted, there):
            yield f"{word} {_listed(there) if there else 'as they are unset'} and not {_listed(wanted)}"
    if options.layout.extras and sorted(options.layout.extras) != sorted(notes.layout.extras):
        yield f"{_listed(notes.layout.extras)} and not {_listed(options.layout.extras)} as columns of their own"
    if options.only and options.only != notes.only:
        yield f"{'some' if notes.only else ALL} of the kept episodes, and not those that --only-… chooses now"


def _are_same(wanted: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether names of axes are these of a dataset, which have `.pos` or `.vel`."""
    pairs = zip(wanted, names, strict=False)
    return len(wanted) == len(names) and all(name in (each, f"{each}.pos", f"{each}.vel") for each, name in pairs)


def _names_in(info: dict[str, Any], column: str) -> list[str]:
    """Return the names of a column's values; empty: whoever wrote the file did not say them."""
    features = info.get("features")
    feature = features.get(column) if isinstance(features, dict) else None
    names = feature.get("names") if isinstance(feature, dict) else None
    return [str(name) for name in names] if isinstance(names, list) else []


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
