"""The episodes of a console's recordings: list them, look at them, change them (docs/episodes.md). Over HTTP."""

import asyncio
import ssl
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import quote

import httpx
import msgspec

from lockstep.client.console_url import ConsoleLink, parse_link
from lockstep.client.errors import ConnectFailed, EditRefused, SignallingRefused
from lockstep.protocol.episodes import EpisodeOutcome

__all__ = ["EpisodePicture", "RecordedEpisode", "RecordedEpisodes", "RecordingInfo", "RecordingWithEpisodes"]

TIMEOUT = 30.0  # s for one request
PENDING_SECONDS = 0.3  # between two requests while the console is still reading files
REPORT_TIMEOUT = 150.0


class RecordedEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """One episode with the changes to it. Times in µs since 1970."""

    id: str  # "edit-3a" of a part that change 3 has made
    number: int  # counts the takes of a recording; the parts of a split have that of the whole
    state: str  # "open", "kept", "discarded", "cut"
    editable: bool  # it was kept, so it can be changed
    restorable: bool  # a change has discarded it
    task: str  # in words
    outcome: EpisodeOutcome  # "success", "failure" or, if nobody has said, ""
    first_event: int  # event reference
    last_event: int  # event reference
    events: int  # from the first to the last: rows of a dataset
    first_bound: int  # event; a trim stays within the bounds
    last_bound: int  # event
    started: int  # time of the first event
    ended: int  # time of the last event
    drivers: list[str]  # names of all that held the seat in it
    problems: list[str]  # what the live checks have seen: "camera_missing front"
    pause: int  # µs, longest time without a new event; 0 if below a second
    made_of: list[str]  # ids of the recorded episodes, of a part or a merge; else empty
    merges_with: str  # id of the one behind it that it can be merged with; "" for none


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """A file of a recording. Times in µs since 1970."""

    id: str  # as in addresses, and as `lockstep recordings` shows it
    name: str  # "" when nobody named it
    robot: str  # its label
    started: int  # of its first record
    ended: int  # of its newest record
    running: bool  # it is being written


class RecordingWithEpisodes(msgspec.Struct, frozen=True, kw_only=True):
    """A recording with its episodes. A change is made of what it says, and refused when there is a newer one."""

    info: RecordingInfo  # of the file
    cameras: list[str]  # of which there are pictures
    revision: int  # number of the newest change
    episodes: list[RecordedEpisode]  # in the order of their events


class EpisodePicture(msgspec.Struct, frozen=True):
    """A picture of a recording."""

    stamp: int  # event that it is stamped with
    jpeg: bytes  # as a file


class _List(msgspec.Struct):
    recordings: list[RecordingWithEpisodes]
    pending: int


class _Problem(msgspec.Struct):
    error: str = ""
    detail: str = ""


_list = msgspec.json.Decoder(_List)
_recording = msgspec.json.Decoder(RecordingWithEpisodes)
_problem = msgspec.json.Decoder(_Problem)


class _ConsoleHttp:
    """Asks a console over HTTP with the token of a link."""

    def __init__(self, link: ConsoleLink, tls_ca: Path | None) -> None:
        self._base = link.base
        self._client = httpx.AsyncClient(
            headers={"Authorization": f"Bearer {link.token}"},
            timeout=TIMEOUT,
            trust_env=not link.loopback,
            verify=ssl.create_default_context(cafile=tls_ca) if link.secure and tls_ca is not None else link.secure,
        )

    async def close(self) -> None:
        await self._client.aclose()

    async def request(self, method: str, path: str, *, json: object = None, seconds: float = TIMEOUT) -> httpx.Response:
        """Return the answer. Raises SignallingRefused and ConnectFailed."""
        try:
            answer = await self._client.request(method, self._base + path, json=json, timeout=seconds)
        except httpx.HTTPError as error:
            raise ConnectFailed(f"no answer from {self._base} ({error or type(error).__name__})") from error
        if answer.is_error:
            try:
                problem = _problem.decode(answer.content)
            except msgspec.DecodeError:
                problem = _Problem(detail=answer.text[:200])
            raise SignallingRefused(answer.status_code, problem.error, problem.detail)
        return answer


class RecordedEpisodes:
    """`async with RecordedEpisodes(link) as recorded:`. Needs no robot, no seat and no connection to the session.

    All methods raise SignallingRefused when the console refuses, and ConnectFailed when it does not answer. Those that
    change something raise EditRefused: `reason` is "stale_edit" when somebody else has changed the recording since.
    """

    def __init__(self, link: str, tls_ca: Path | None = None) -> None:
        """`tls_ca`: a file with a certificate to trust instead of the system's. Raises LinkFormatError."""
        self._console = _ConsoleHttp(parse_link(link), tls_ca)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._console.close()

    async def recordings(self) -> list[RecordingWithEpisodes]:
        """Return the recordings, the one that changed last first, when the console has read all of them."""
        while True:
            found = _list.decode((await self._console.request("GET", "/api/episodes")).content)
            if not found.pending:
                return found.recordings
            await asyncio.sleep(PENDING_SECONDS)

    async def of(self, recording: str) -> RecordingWithEpisodes:
        """Return one recording, by its id."""
        return _recording.decode((await self._console.request("GET", _path(recording, "episodes"))).content)

    async def picture(self, recording: str, camera: str, event: int, width: int = 320) -> EpisodePicture:
        """Return the picture that belongs to an event, as a dataset's row has it. `width`: 160, 320 or 640 pixels."""
        query = f"?camera={quote(camera, safe='')}&event={event}&width={width}"
        answer = await self._console.request("GET", _path(recording, "picture") + query)
        return EpisodePicture(int(answer.headers.get("Lockstep-Event", "0")), answer.content)

    async def report(self, recording: str) -> bytes:
        """Return a report of a closed recording, an HTML page."""
        return (await self._console.request("GET", _path(recording, "report"), seconds=REPORT_TIMEOUT)).content

    # changes; all return the recording as it is then

    async def relabel(
        self,
        recording: RecordingWithEpisodes,
        episode: str,
        *,
        task: str | None = None,
        outcome: EpisodeOutcome | None = None,
    ) -> RecordingWithEpisodes:
        """Give an episode another task or outcome. None: as it is."""
        words = {name: value for name, value in (("task", task), ("outcome", outcome)) if value is not None}
        return await self._change(recording, episode=episode, **words)

    async def trim(
        self, recording: RecordingWithEpisodes, episode: str, first_event: int, last_event: int
    ) -> RecordingWithEpisodes:
        """Let an episode begin and end at other events, within its bounds."""
        return await self._change(recording, episode=episode, first_event=first_event, last_event=last_event)

    async def split(self, recording: RecordingWithEpisodes, episode: str, event: int) -> RecordingWithEpisodes:
        """Make two of an episode; the second one begins at `event`."""
        return await self._change(recording, episode=episode, split=event)

    async def merge(self, recording: RecordingWithEpisodes, episode: str, following: str) -> RecordingWithEpisodes:
        """Make one of an episode and the one right behind it."""
        return await self._change(recording, episode=episode, merge=following)

    async def discard(self, recording: RecordingWithEpisodes, episode: str) -> RecordingWithEpisodes:
        """Take an episode out of every dataset that is made from now on."""
        return await self._change(recording, episode=episode, dropped=True)

    async def restore(self, recording: RecordingWithEpisodes, episode: str) -> RecordingWithEpisodes:
        """Put an episode back that `discard` has taken out."""
        return await self._change(recording, episode=episode, dropped=False)

    async def undo(self, recording: RecordingWithEpisodes, change: int) -> RecordingWithEpisodes:
        """Take back the change with this number."""
        return await self._change(recording, undo=change)

    async def _change(self, recording: RecordingWithEpisodes, **change: str | int | bool) -> RecordingWithEpisodes:
        body = {"revision": recording.revision, **change}
        try:
            answer = await self._console.request("POST", _path(recording.info.id, "episodes"), json=body)
        except SignallingRefused as refused:
            if refused.error in ("stale_edit", "edit_refused"):
                raise EditRefused(refused.error, refused.detail) from refused
            raise
        return _recording.decode(answer.content)


def _path(recording: str, what: str) -> str:
    return f"/api/recordings/{quote(recording, safe='')}/{what}"
