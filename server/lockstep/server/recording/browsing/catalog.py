"""The episodes of all recordings, their pictures, and changes to them, for the HTTP routes.

Closed files are read by the worker process; the answers are kept, up to a bound, as long as the files do not change.
Of the file that is being written this process has the index. Nothing here waits for a slow file longer than a bound.
"""

import math
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import msgspec

from lockstep.server.errors import (
    AlreadyRecording,
    BadParameter,
    ConsoleError,
    EditRefused,
    NotAllowed,
    NotFound,
    RecordingFailed,
    RecordingUnreadable,
    StaleEdit,
    TooManyRequests,
)
from lockstep.server.recording.browsing.jobs import ListEpisodes, MakeReport, ShowPicture
from lockstep.server.recording.browsing.worker import RecordingWorker
from lockstep.server.recording.episodes.edit_rules import EditedEpisode, EpisodeEdit, apply_edits
from lockstep.server.recording.episodes.edits import EpisodeEditRefused, EpisodeEditStale, add_edit, read_edits
from lockstep.server.recording.episodes.episode_list import RecordingEpisodes, listed_episodes
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.event_index import EventEntry, EventIndex
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.library import Library
from lockstep.server.recording.reading.picture_at import PictureAt
from lockstep.server.recording.recording_store import FileVersion, file_version, is_written, recording_id
from lockstep.server.recording.rights import RecordingReaderRight

__all__ = ["CatalogPage", "EpisodeCatalog", "InThread"]

MAX_FILES = 500  # in one answer
MAX_EPISODES = 20_000  # in one answer; the rest is counted as older
MAX_LIST_BYTES = 8 * 1024 * 1024  # of one file's list, about MAX_EPISODES: it is parsed on the loop
MAX_KEPT_BYTES = 48 * 1024 * 1024  # of lists, as JSON
MAX_PICTURE_BYTES = 24 * 1024 * 1024
LIST_SECONDS = 20.0  # for one file; an interrupted one is read as a whole
PICTURE_SECONDS = 10.0
REPORT_SECONDS = 120.0
RETRY_SECONDS, MOST_RETRY_SECONDS = 30.0, 960.0  # until a list that failed is tried again; doubled each time
MAX_REPORT_BYTES = 1_000_000_000  # of a recording; the command line makes reports of larger ones
PATIENCE = 1.5  # s of one answer for files that were not read yet; the next answer goes on


class InThread(Protocol):
    """Runs what blocks."""

    def __call__(self, work: Callable[[], Any]) -> Awaitable[Any]: ...


class _Known(NamedTuple):
    version: FileVersion
    listed: RecordingEpisodes | None  # None: it cannot be read
    text: bytes  # JSON
    tries: int = 0  # failures in a row of what may do later
    again_at: float = math.inf  # s, monotonic: when it is read again although it has not changed

    def holds(self, version: FileVersion, now: float) -> bool:
        """Return whether this is what is known of that version of the file."""
        return self.version == version and now < self.again_at


class CatalogPage(NamedTuple):
    """Lists of several recordings, each as JSON.

    Attributes:
        older: files that were left out behind these
        pending: files that were not read yet: ask again
        unreadable: files that are no recordings, or damaged
    """

    recordings: list[bytes]
    older: int
    pending: int
    unreadable: int


class EpisodeCatalog:
    """`close` it. All methods are called on the loop."""

    def __init__(
        self,
        library: Library,
        in_thread: InThread,
        worker: RecordingWorker | None = None,
        clock: Callable[[], float] = time.monotonic,
        is_driven: Callable[[], bool] = lambda: False,
    ) -> None:
        """`in_thread`: runs what blocks. `clock`: s, monotonic. `is_driven`: whether somebody drives a robot here."""
        self._clock = clock
        self._library = library
        self._in_thread = in_thread
        self._worker = worker or RecordingWorker(is_driven=is_driven)
        self._reports = RecordingWorker(max_waiting=4)  # a report takes long: pictures do not wait for it
        self._known: OrderedDict[Path, _Known] = OrderedDict()
        self._kept_bytes = 0
        self._pictures: OrderedDict[tuple[object, ...], PictureAt] = OrderedDict()
        self._picture_bytes = 0

    @property
    def workers(self) -> list[int]:
        """The processes that run now."""
        return [each.pid for each in (self._worker, self._reports) if each.pid is not None]

    async def close(self) -> None:
        await self._worker.close()
        await self._reports.close()

    # lists

    async def page(self, right: RecordingReaderRight, skip: int = 0) -> CatalogPage:
        """Return the recordings that changed last, but for the first `skip`. Raises ConsoleError, OSError."""
        found, unreadable, pending, episodes = [], 0, 0, 0
        running, files = await self._in_thread(self._files)
        until = self._clock() + PATIENCE
        wanted = files[skip : skip + MAX_FILES]
        if running is not None and not skip:
            listed = await self._in_thread(lambda: self._list_running(running))
            if listed is not None and right.sees(listed.info.ended):
                found.append(msgspec.json.encode(_seen(listed, right)))
                episodes += len(listed.episodes)
        taken = 0
        for path, version in wanted:
            if episodes > MAX_EPISODES:
                break
            taken += 1
            known = self._known.get(path)
            if known is None or not known.holds(version, self._clock()):
                if self._clock() > until:
                    pending += 1
                    continue
                try:
                    known = await self._list(path, version)
                except TooManyRequests:
                    pending += 1
                    continue
            self._known.move_to_end(path)
            if known.listed is None:
                unreadable += 1
            elif right.sees(known.listed.info.ended):
                seen = _seen(known.listed, right)
                found.append(known.text if seen is known.listed else msgspec.json.encode(seen))
                episodes += len(known.listed.episodes)
        return CatalogPage(found, max(0, len(files) - skip - taken), pending, unreadable)

    async def one(self, recording_id: str, right: RecordingReaderRight) -> RecordingEpisodes:
        """Return one recording with its episodes. Raises ConsoleError, OSError, RecordingError."""
        path, running = await self._in_thread(lambda: (self._library.path(recording_id), self._library.running()))
        if path == running:
            listed = await self._in_thread(lambda: self._list_running(path))
        else:
            version = await self._in_thread(lambda: file_version(path))
            known = self._known.get(path)
            if known is None or not known.holds(version, self._clock()):
                known = await self._list(path, version)
            listed = known.listed
        if listed is None:
            raise RecordingUnreadable("this recording cannot be read")
        if not right.sees(listed.info.ended):
            raise NotAllowed("this was recorded before your link was made")
        return _seen(listed, right)

    def _files(self) -> tuple[Path | None, list[tuple[Path, FileVersion]]]:
        """Return the file that is being written, and the closed ones with their versions. Blocks."""
        running = self._library.running()
        found = []
        for path in self._library.files():
            try:
                version = file_version(path)
                known = self._known.get(path)
                if path != running and ((known is not None and known.version == version) or not is_written(path)):
                    found.append((path, version))
            except OSError:
                continue  # it was deleted meanwhile
        return running, found

    async def _list(self, path: Path, version: FileVersion) -> _Known:
        """Have a file read. One that is damaged is not read again before it has changed; a failure is tried again."""
        try:
            text = await self._worker.ask(ListEpisodes(str(path)), LIST_SECONDS)
            if len(text) > MAX_LIST_BYTES:
                raise RecordingUnreadable("it has far too many episodes")
            known = _Known(version, _decoder.decode(text), text)
        except (TooManyRequests, NotFound):
            raise
        except RecordingFailed:
            before = self._known.get(path)
            tries = before.tries if before is not None and before.version == version else 0
            wait = min(RETRY_SECONDS * 2.0 ** min(tries, 10), MOST_RETRY_SECONDS)
            known = _Known(version, None, b"", tries + 1, self._clock() + wait)
        except (ConsoleError, msgspec.DecodeError):
            known = _Known(version, None, b"")
        self._forget(path)
        self._known[path] = known
        self._kept_bytes += len(known.text)
        while self._kept_bytes > MAX_KEPT_BYTES and len(self._known) > 1:
            self._forget(next(iter(self._known)))
        return known

    def _forget(self, path: Path) -> None:
        known = self._known.pop(path, None)
        self._kept_bytes -= 0 if known is None else len(known.text)

    def _list_running(self, path: Path) -> RecordingEpisodes | None:
        """Blocks."""
        try:
            reader, entry = self._library.open(recording_id(path))
            with reader:
                return listed_episodes(entry, reader.index, read_edits(path))
        except (ConsoleError, RecordingError, OSError):
            return None  # it has just ended

    # pictures

    async def picture(
        self, recording_id: str, camera: str, event: int, width: int, right: RecordingReaderRight
    ) -> PictureAt:
        """Return the picture of an event. Raises ConsoleError, OSError, RecordingError."""
        job, inode = await self._in_thread(lambda: self._picture_job(recording_id, camera, event, width, right))
        key = (job.path, inode, camera, event, width, right.since)
        known = self._pictures.get(key)
        if known is not None:
            self._pictures.move_to_end(key)
            return known
        body = await self._worker.ask(job, PICTURE_SECONDS)
        found = PictureAt(int.from_bytes(body[:4], "big"), body[4:])
        if job.index is None or found.stamp == event:  # a newer one may still come into a file that is being written
            self._keep(key, found)
        return found

    def _picture_job(
        self, recording_id: str, camera: str, event: int, width: int, right: RecordingReaderRight
    ) -> tuple[ShowPicture, int]:
        """Blocks."""
        path = self._library.path(recording_id)
        inode = path.stat().st_ino
        index = None
        if path == self._library.running():
            reader, _ = self._library.open(recording_id)
            with reader:
                index = _needed(right.part_of(reader.index), CAMERA + camera, event)
            if index is None:
                raise NotFound("there is no picture of this camera at this event")
        job = ShowPicture(path=str(path), camera=camera, event=event, width=width, since=right.since, index=index)
        return job if index is None else msgspec.structs.replace(job, since=None), inode

    def _keep(self, key: tuple[object, ...], found: PictureAt) -> None:
        before = self._pictures.pop(key, None)
        self._picture_bytes += len(found.jpeg) - (0 if before is None else len(before.jpeg))
        self._pictures[key] = found
        while self._picture_bytes > MAX_PICTURE_BYTES:
            _, oldest = self._pictures.popitem(last=False)
            self._picture_bytes -= len(oldest.jpeg)

    # changes

    async def change(
        self,
        recording_id: str,
        edit: EpisodeEdit,
        revision: int,
        right: RecordingReaderRight,
        check: Callable[[], None],
    ) -> RecordingEpisodes:
        """Make a change that its author made of `revision`; return the recording as it is then.

        `check`: called on another thread right before the change; raises ConsoleError if its author may not any more.

        Raises:
            StaleEdit, EditRefused, NotAllowed, NotFound, RecordingError, OSError: it is not made.
        """
        await self._in_thread(lambda: self._change(recording_id, edit, revision, right, check))
        return await self.one(recording_id, right)

    def _change(
        self,
        recording_id: str,
        edit: EpisodeEdit,
        revision: int,
        right: RecordingReaderRight,
        check: Callable[[], None],
    ) -> None:
        """Blocks."""
        reader, _ = self._library.open(recording_id)
        with reader:
            path, recorded = reader.path, reader.index.episodes
        if right.since is not None:
            edits = read_edits(path)[:revision]
            before, after = apply_edits(recorded, edits).episodes, apply_edits(recorded, [*edits, edit]).episodes
            if not all(right.reads(each.entry.started) for each in _differing(before, after)):
                raise NotAllowed("an episode of this change was recorded before your link was made")
        check()
        try:
            add_edit(path, recorded, edit, after=revision)
        except EpisodeEditStale as error:
            raise StaleEdit(error.detail) from error
        except EpisodeEditRefused as error:
            raise EditRefused(error.detail) from error

    # reports

    async def report(self, recording_id: str, right: RecordingReaderRight) -> bytes:
        """Return a report of a closed recording, an HTML page. Raises ConsoleError, OSError, RecordingError."""

        def job() -> MakeReport:
            path = self._library.path(recording_id)
            if path == self._library.running() or is_written(path):
                raise AlreadyRecording("the recording is still being written; stop it first")
            if path.stat().st_size > MAX_REPORT_BYTES:
                raise BadParameter("it is too long for a report here: use `lockstep report`")
            reader, entry = self._library.open(recording_id)
            with reader:
                right.check_reads(entry.started)
            return MakeReport(str(path))

        return await self._reports.ask(await self._in_thread(job), REPORT_SECONDS)


_decoder = msgspec.json.Decoder(RecordingEpisodes)


def _seen(listed: RecordingEpisodes, right: RecordingReaderRight) -> RecordingEpisodes:
    """Return the part of it that may be seen; the same object, if that is all of it."""
    if right.since is None or all(right.reads(each.started) for each in listed.episodes):
        return listed
    episodes = [each for each in listed.episodes if right.reads(each.started)]
    known = {each.id for each in episodes}
    changes = [each for each in listed.changes if each.episode in known]
    return msgspec.structs.replace(listed, episodes=episodes, changes=changes)


def _differing(before: list[EditedEpisode], after: list[EditedEpisode]) -> list[EditedEpisode]:
    """Return the episodes that are not the same in both, of both."""
    known, found = ({each.entry.id: each for each in episodes} for episodes in (before, after))
    return [each for id, each in (*known.items(), *found.items()) if known.get(id) != found.get(id)]


def _needed(index: EventIndex, topic: str, event: int) -> EventIndex | None:
    """Return an index of the chunks that the picture of an event is in; None: there is none."""
    start = index.keyframe_before(topic, event)
    if start is None:
        return None
    last = max(index.chunks_with(event, event), default=start.chunk)
    keyframe = EventEntry(start.event, start.arrived, 0)
    return msgspec.structs.replace(
        index,
        chunks=index.chunks[start.chunk : max(last, start.chunk) + 1],
        keyframes={topic: [keyframe]},
        events=[],
        marks=[],
        episodes=[],
        counts={},
    )
