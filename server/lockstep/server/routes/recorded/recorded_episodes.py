"""The episodes of recordings over HTTP: the list, pictures, changes, reports (docs/episodes.md)."""

import hashlib
import time
from typing import Annotated

import msgspec
from fastapi import APIRouter, Query, Request, Response

from lockstep.protocol.episodes import EpisodeOutcome, Task
from lockstep.protocol.serial import MAX_EVENT
from lockstep.server.auth.tokens import require_role
from lockstep.server.errors import BadParameter, TooManyRequests
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.request_body import read_json
from lockstep.server.recording.browsing.catalog import CatalogPage
from lockstep.server.recording.episodes.edits import EpisodeEdit
from lockstep.server.recording.episodes.episode_list import RecordingEpisodes
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.records import Whole
from lockstep.server.routes.recorded.recordings import (
    Caller,
    RecordingService,
    check_still,
    reader_right,
    recording_error,
    recording_service,
)
from lockstep.server.util.display_names import printable

__all__ = ["EpisodeChangeBody", "EpisodeList", "router"]

router = APIRouter()

WIDTHS = (160, 320, 640)  # pixels, of pictures: few, so that a kept one serves many
Id = Annotated[str, msgspec.Meta(max_length=80)]


class EpisodeList(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/episodes."""

    version: str  # differs when anything of the answer does
    unchanged: bool = False  # it is as `known` said; there are no recordings in this answer then
    recordings: list[RecordingEpisodes]  # the running one first, then those that changed last
    older: int = 0  # number of files that were left out behind these
    pending: int = 0  # number of files that are not read yet: ask again
    unreadable: int = 0  # number of files that cannot be read


class EpisodeChangeBody(msgspec.Struct, frozen=True, kw_only=True):
    """Body of POST /api/recordings/{id}/episodes: one kind of change of one episode, or an undo."""

    revision: Whole  # of the recording's episodes that the change was made of
    episode: Id = ""
    task: Task | None = None
    outcome: EpisodeOutcome | None = None
    first_event: Whole | None = None
    last_event: Whole | None = None
    dropped: bool | None = None
    split: Whole | None = None
    merge: Id | None = None
    undo: Whole | None = None


@router.get("/api/episodes")
async def episodes(
    request: Request,
    caller: Caller,
    skip: Annotated[int, Query(ge=0, le=1_000_000)] = 0,
    known: Annotated[str, Query(max_length=64)] = "",
) -> Response:
    """The episodes of all recordings, with the changes to them."""
    service = recording_service(request)
    _spend_list(service, caller.token_id)
    try:
        page = await service.catalog.page(reader_right(request, caller), skip)
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    # It may have many megabytes, and whoever drives waits for the loop.
    body = await service.in_thread(lambda: _list_body(page, known))
    check_still(caller)
    return Response(body, media_type="application/json", headers={"Cache-Control": "no-store"})


def _spend_list(service: RecordingService, link: str) -> None:
    if not service.lists.spend(link, time.monotonic()):
        raise TooManyRequests("the episodes are asked for too often with this link")


def _list_body(page: CatalogPage, known: str) -> bytes:
    digest = hashlib.blake2b(repr(page[1:]).encode(), digest_size=12)
    for each in page.recordings:
        digest.update(each)
    version = digest.hexdigest()
    if version == known:
        return msgspec.json.encode(EpisodeList(version=version, unchanged=True, recordings=[]))
    return msgspec.json.encode(
        {
            "version": version,
            "unchanged": False,
            "recordings": list(map(msgspec.Raw, page.recordings)),
            "older": page.older,
            "pending": page.pending,
            "unreadable": page.unreadable,
        }
    )


@router.get("/api/recordings/{recording_id}/episodes")
async def of_recording(request: Request, caller: Caller, recording_id: str) -> Response:
    service = recording_service(request)
    _spend_list(service, caller.token_id)
    try:
        found = await service.catalog.one(recording_id, reader_right(request, caller))
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    check_still(caller)
    return json_answer(found)


@router.post("/api/recordings/{recording_id}/episodes")
async def change(request: Request, caller: Caller, recording_id: str) -> Response:
    """Operators and supervisors."""
    require_role(caller, "operator", "supervisor")
    service = recording_service(request)
    if not service.edits.spend(caller.token_id, time.monotonic()):
        raise TooManyRequests("episodes are changed too often with this link")
    body = await read_json(request, EpisodeChangeBody)
    require_role(caller, "operator", "supervisor")  # again: the right may have ended while the body came
    edit = EpisodeEdit(
        episode=body.episode,
        at=round(time.time(), 3),
        by=printable(caller.name),
        task=None if body.task is None else printable(body.task),
        outcome=body.outcome,
        first_event=body.first_event,
        last_event=body.last_event,
        dropped=body.dropped,
        split=body.split,
        merge=body.merge,
        undo=body.undo,
    )
    actor = caller.actor
    try:
        right = reader_right(request, caller)
        found = await service.catalog.change(recording_id, edit, body.revision, right, lambda: check_still(caller))
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    service.audit.record("recording", actor, "episode changed", f"{recording_id} change {body.revision + 1}")
    return json_answer(found)


@router.get("/api/recordings/{recording_id}/picture")
async def picture(
    request: Request,
    caller: Caller,
    recording_id: str,
    event: Annotated[int, Query(ge=1, le=MAX_EVENT)],
    camera: Annotated[str, Query(min_length=1, max_length=80)],
    width: int = WIDTHS[0],
) -> Response:
    """The picture that belongs to an event, as a dataset's row has it. `Lockstep-Event`: its own stamp."""
    if width not in WIDTHS:
        raise BadParameter("a picture is 160, 320 or 640 pixels wide")
    service = recording_service(request)
    if not service.pictures.spend(caller.token_id, time.monotonic()):
        raise TooManyRequests("pictures of recordings are asked for too often with this link")
    right, actor = reader_right(request, caller), caller.actor
    try:
        found = await service.catalog.picture(recording_id, camera, event, width, right)
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    check_still(caller)
    service.audit.again("reading", actor, recording_id)
    headers = {"Cache-Control": "no-store", "Lockstep-Event": str(found.stamp)}
    return Response(found.jpeg, media_type="image/jpeg", headers=headers)


@router.get("/api/recordings/{recording_id}/report")
async def report(request: Request, caller: Caller, recording_id: str) -> Response:
    """A page with what was kept, lost and refused; it needs nothing else. For those who may have the file."""
    require_role(caller, "operator", "supervisor")
    service = recording_service(request)
    if not service.reports.spend(caller.token_id, time.monotonic()):
        raise TooManyRequests("reports are asked for too often with this link")
    right, actor = reader_right(request, caller), caller.actor
    try:
        page = await service.catalog.report(recording_id, right)
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    check_still(caller)
    service.audit.record("recording", actor, "report", recording_id)
    headers = {"Cache-Control": "no-store", "Content-Disposition": 'attachment; filename="report.html"'}
    return Response(page, media_type="text/html; charset=utf-8", headers=headers)
