"""Which files become one episode as a whole: those of a recording that was certainly not made by episodes. Blocks.

A file without a record of an episode may still show parts of one: of a take that outgrew the file before it and was
discarded then, or of what lies between two. So what counts is the recording, not the file: each part says at its head
whether an episode was begun before it, and the last one at its end whether one was begun at all.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.event_index import Ending, EventIndex
from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import scan_file

__all__ = ["EpisodeUse", "whole_recordings", "why_not_whole"]

EPISODE = OWN_TOPICS[EpisodeRecord]


class EpisodeUse(NamedTuple):
    """What a file says of the episodes of its recording."""

    path: Path
    recording: str
    before: Literal["", "none", "begun"]  # as in RecordingInfo
    cut: str
    has_records: bool  # of an episode, as far as it is known
    ending: Ending

    @property
    def by_episodes(self) -> bool:
        return self.has_records or self.before == "begun" or bool(self.cut) or self.ending == "episodes"

    @property
    def may_be_whole(self) -> bool:
        """False if the file says itself that it is not one episode as a whole."""
        return self.before == "none" and not self.by_episodes


def why_not_whole(file: EpisodeUse, seen: Sequence[EpisodeUse], beside: str = "") -> str:
    """Return why a file is not one episode as a whole; "" if it is. No I/O.

    Args:
        seen: all that become one dataset, and the other parts of the same recording that are there
        beside: what else is in that dataset and has episodes; "": nothing
    """
    own = [each for each in seen if each.recording == file.recording]
    if file.cut:
        return f"it begins within episode {file.cut}, which is whole in no file and so was not kept"
    if told := next((each for each in own if each.by_episodes), None):
        return f"its recording was made by episodes, as {told.path.name} says"
    if file.before == "":
        return "an earlier version made it, and it does not say whether its recording was made by episodes"
    if not any(each.ending == "no_episodes" for each in own):
        return "no file here says that its recording has ended without an episode"
    other = next((each.path.name for each in seen if each.by_episodes), beside)
    return f"{other} has episodes, and this one has none" if other else ""


def whole_recordings(paths: Sequence[Path], *, wanted: bool, beside: str = "") -> Mapping[Path, str]:
    """Return of each file, if it has no episodes, why it is not one as a whole; "" if it is.

    Args:
        paths: all that become one dataset
        wanted: somebody has asked for it: each is one
        beside: as of `why_not_whole`
    """
    if wanted:
        return dict.fromkeys(paths, "")
    given = [use for path in paths if (use := _said(path)) is not None]
    if any(use.may_be_whole for use in given):  # else all is said: reading records takes as long as an export
        given = [use for said in given if (use := _with_records(said)) is not None]
        seen = [*given, *_other_parts(given)]
    else:
        seen = given
    found = {use.path: why_not_whole(use, seen, beside) for use in given}
    return {path: found.get(path, "it cannot be read") for path in paths}


def _other_parts(given: Sequence[EpisodeUse]) -> Iterator[EpisodeUse]:
    """Yield the other parts of recordings of which no given part has a record of an episode."""
    unclear = {use.recording for use in given} - {use.recording for use in given if use.by_episodes}
    known = {use.path.resolve() for use in given}
    for folder in {path.parent for path in known} if unclear else ():
        for path in sorted(folder.glob("*.mcap")):
            if path in known or _recording(path) not in unclear:
                continue
            said = _said(path)
            use = None if said is None else _with_records(said)
            if use is not None:
                yield use


def _recording(path: Path) -> str:
    try:
        with RecordingReader(path, EventIndex()) as reader:  # its head alone is read
            return reader.info.recording
    except (RecordingError, OSError):
        return ""


def _said(path: Path) -> EpisodeUse | None:
    """Return what the file says at its head and at its end; None: it cannot be read."""
    try:
        with RecordingReader(path) as reader:
            info, index = reader.info, reader.index
            has_records = bool(index.counts.get(EPISODE))
            return EpisodeUse(path, info.recording, info.episodes, info.cut, has_records, index.ending)
    except (RecordingError, OSError):
        return None


def _with_records(said: EpisodeUse) -> EpisodeUse | None:
    """Return what the file says with its records too, unless it is decided; None: it cannot be read."""
    if said.by_episodes:
        return said
    try:
        with RecordingReader(said.path) as reader:
            info, indexed = reader.info, {chunk.offset for chunk in reader.index.chunks}
        # Nothing checks an index, of what is where nor of how many: only the records themselves count.
        scan = scan_file(said.path, info)
        if not indexed <= {chunk.chunk_start_offset for chunk in scan.chunks}:
            return None  # it is broken before its end, and what follows is not known
        return said._replace(has_records=bool(scan.index.counts.get(EPISODE)))
    except (RecordingError, OSError):
        return None
