"""The HTTP API of recordings (docs/recording.md). Files are read in threads, never on the loop."""

import gzip
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, TypeVar, get_args

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse, StreamingResponse

from lockstep.protocol.console import RecordingState, Role
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import MAX_EVENT, event_gap
from lockstep.server.auth.tokens import Right, require_role
from lockstep.server.errors import (
    BadParameter,
    ConsoleError,
    NotAllowed,
    NotFound,
    RecordingFailed,
    RecordingUnreadable,
    RobotFailed,
    TooManyRequests,
)
from lockstep.server.http.ending_response import EndingResponse
from lockstep.server.http.request_body import read_json
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.library import Library
from lockstep.server.recording.reading.reader import Record, RecordingReader
from lockstep.server.recording.recording_store import RecordingEntry
from lockstep.server.recording.rights import RecordingReaderRight, check_end
from lockstep.server.recording.service import RecordingService
from lockstep.server.state.dependencies import known_caller
from lockstep.server.util.display_names import printable

__all__ = [
    "MAX_LISTED",
    "FileTicket",
    "RecordingDetails",
    "RecordingList",
    "RecordingRequest",
    "Caller",
    "RecordingService",
    "reader_right",
    "recording_error",
    "recording_service",
    "router",
]

router = APIRouter()

MAX_LISTED = 500  # recordings in one answer
MAX_EVENTS = 10_000  # in one answer of `records`
MAX_BYTES = 64 * 1024 * 1024
EVENT_SPACING = 1_000_000  # µs between events of the index that is sent

Result = TypeVar("Result")
Event = Annotated[int, Query(ge=1, le=MAX_EVENT)]


class RecordingRequest(msgspec.Struct, frozen=True):
    """Body of POST /api/recordings."""

    name: Annotated[str, msgspec.Meta(max_length=80)] = ""


class RecordingList(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/recordings."""

    state: RecordingState
    recordings: list[RecordingEntry]  # the newest first
    older: int  # number of older ones that were left out


class RecordingDetails(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/recordings/{id}."""

    info: RecordingEntry
    description: RobotDescription | None  # None before its first chunk is written
    index: EventIndex


class FileTicket(msgspec.Struct, frozen=True):
    """Answer of POST /api/recordings/{id}/ticket."""

    path: str


def recording_service(request: Request) -> RecordingService:
    found = request.app.state.recordings
    if found is None:
        raise RobotFailed("the console's session of this robot has failed; it is started again")
    if not isinstance(found, RecordingService):
        raise TypeError("the app is not running")
    return found


async def _caller(request: Request) -> Right:
    return known_caller(request, recording_service(request).access.bearer(request.headers.get("authorization")))


Caller = Annotated[Right, Depends(_caller)]


def reader_right(request: Request, caller: Right) -> RecordingReaderRight:
    """Return the caller's right to read recordings."""
    identity = caller.identity
    if recording_service(request).opens_all:
        return RecordingReaderRight(identity.role, None)
    return RecordingReaderRight.of(identity.role, identity.issued)


def _told_audit(request: Request, caller: Right, what: str, recording_id: str) -> None:
    recording_service(request).audit.record("recording", caller.actor, what, recording_id)


@router.get("/api/recordings")
async def recordings(
    request: Request,
    caller: Caller,
    before: Annotated[int, Query(ge=0)] = 0,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = MAX_LISTED,
) -> Response:
    """The newest; with `before` the newest of those that began before that time, in µs since 1970."""
    library = recording_service(request).library
    return _json(await _list(request, library, caller, before, limit))


@router.post("/api/recordings")
async def start(request: Request, caller: Caller) -> Response:
    require_role(caller, "operator", "supervisor")
    wanted = await read_json(request, RecordingRequest)
    service = recording_service(request)
    if not service.starts.spend(caller.token_id, time.monotonic()):
        raise TooManyRequests("recordings begin too often with this link")
    state = service.library.start(caller.name, printable(wanted.name))
    _told_audit(request, caller, "started", state.recording)
    return _json(state, 201)


@router.post("/api/recordings/stop")
async def stop(request: Request, caller: Caller) -> Response:
    """Answers when the file is closed."""
    service = recording_service(request)
    holds_seat = service.holds_seat(caller.token_id)
    check_end(caller.role, automatic=service.library.automatic, holds_seat=holds_seat)
    running = service.library.state().recording
    actor = caller.actor
    state = await service.library.stop()
    if running:
        service.audit.record("recording", actor, "ended", running)
    return _json(state)


@router.get("/api/recordings/{recording_id}")
async def details(
    request: Request, caller: Caller, recording_id: str, after: Annotated[int, Query(ge=0)] = 0
) -> Response:
    """`after`: only what the index has from that chunk on, for one who follows a running recording."""

    packed = "gzip" in request.headers.get("accept-encoding", "")
    right = reader_right(request, caller)
    actor = caller.actor

    def read(reader: RecordingReader, entry: RecordingEntry) -> bytes:
        whole = right.part_of(reader.index)
        description = reader.description() if reader.index.chunks else None
        index = whole.after(after).sparse(EVENT_SPACING)
        body = msgspec.json.encode(RecordingDetails(info=entry, description=description, index=index))
        return gzip.compress(body, compresslevel=1) if packed else body

    body = await _with_reader(request, recording_id, read)
    check_still(caller)
    recording_service(request).audit.again("reading", actor, recording_id)
    headers = {"Cache-Control": "no-store", "Vary": "Accept-Encoding"} | (
        {"Content-Encoding": "gzip"} if packed else {}
    )
    return Response(body, media_type="application/json", headers=headers)


@router.get("/api/recordings/{recording_id}/chunks/{number}")
async def chunk(request: Request, caller: Caller, recording_id: str, number: int) -> Response:
    """A chunk never changes, but who may read it does: nobody keeps it."""
    right = reader_right(request, caller)
    actor = caller.actor

    def read(reader: RecordingReader, entry: RecordingEntry) -> bytes:
        if not 0 <= number < len(reader.index.chunks):
            raise NotFound("no such chunk")
        right.check_reads(reader.index.chunks[number].started)
        return b"".join(map(_framed, reader.chunk(number)))

    body = await _with_reader(request, recording_id, read)
    check_still(caller)
    recording_service(request).audit.again("reading", actor, recording_id)
    headers = {"Cache-Control": "no-store"}
    return Response(body, media_type="application/octet-stream", headers=headers)


@router.get("/api/recordings/{recording_id}/records")
async def records(
    request: Request,
    caller: Caller,
    recording_id: str,
    first: Annotated[int, Query(alias="from", ge=1, le=MAX_EVENT)],
    last: Annotated[int, Query(alias="to", ge=1, le=MAX_EVENT)],
    topic: Annotated[list[str] | None, Query(max_length=50)] = None,
    decodable: bool = False,
) -> Response:
    """By events."""
    if not 0 <= event_gap(last, first) <= MAX_EVENTS:
        raise BadParameter(f"from 0 to {MAX_EVENTS} events at once")
    topics = None if topic is None else frozenset(topic)
    right = reader_right(request, caller)
    actor = caller.actor
    reader, _ = await _open(request, recording_id)
    try:
        right.part_of(reader.index)
    except NotAllowed:
        reader.close()
        raise
    recording_service(request).audit.again("reading", actor, recording_id)
    # The response closes the iterator, and with it the file, also when the client is gone.
    body = _bounded(reader, first, last, topics, decodable, right)
    answer = StreamingResponse(body, media_type="application/octet-stream", headers={"Cache-Control": "no-store"})
    return EndingResponse(answer, caller)


@router.post("/api/recordings/{recording_id}/ticket")
async def ticket(request: Request, caller: Caller, recording_id: str) -> Response:
    """For a link that the browser downloads by itself: it sends no token."""
    require_role(caller, "operator", "supervisor")
    right = reader_right(request, caller)
    actor = caller.actor
    await _with_reader(request, recording_id, lambda reader, entry: right.check_reads(entry.started))
    check_still(caller)
    recording_service(request).audit.record("recording", actor, "downloaded", recording_id)
    root = request.scope.get("root_path", "")
    permission = recording_service(request).access.issue_file_ticket(recording_id, caller.identity)
    return _json(FileTicket(f"{root}/api/recordings/{recording_id}/file?ticket={permission}"))


@router.get("/api/recordings/{recording_id}/file")
async def download(request: Request, recording_id: str, ticket: str = "") -> Response:
    """Of a running recording what is there now; `lockstep export` and other tools take that too."""
    access = recording_service(request).access
    right = None
    if ticket:  # it was audited, and checked against the link, when it was made
        caller = access.verify_file_ticket(ticket, recording_id)
    else:
        caller = await _caller(request)
        right = reader_right(request, caller)
    require_role(caller, "operator", "supervisor")

    def read(reader: RecordingReader, entry: RecordingEntry) -> Path:
        if right is not None:
            right.check_reads(entry.started)
        return reader.path

    path = await _with_reader(request, recording_id, read)
    if not ticket:
        _told_audit(request, caller, "downloaded", recording_id)
    answer = FileResponse(
        path, media_type="application/x-mcap", filename=f"{recording_id}.mcap", headers={"Cache-Control": "no-store"}
    )
    return EndingResponse(answer, caller)


@router.delete("/api/recordings/{recording_id}")
async def delete(request: Request, caller: Caller, recording_id: str) -> Response:
    require_role(caller, "supervisor")
    actor = caller.actor  # also for the audit, should the link end meanwhile
    service = recording_service(request)
    library = service.library

    def delete_it() -> None:
        require_role(caller, "supervisor")  # again: the threads may have been busy for long
        library.delete(recording_id)

    try:
        await service.in_thread(delete_it)
    except OSError as error:
        raise RecordingFailed(error.strerror or str(error)) from error
    service.audit.record("recording", actor, "deleted", recording_id)
    return _json(await _list(request, library, caller))


def check_still(caller: Right) -> None:
    """Check the right again before the answer: its work may have waited. Raises ConsoleError: it has ended."""
    require_role(caller, *get_args(Role))


async def _list(
    request: Request, library: Library, caller: Right, before: int = 0, limit: int = MAX_LISTED
) -> RecordingList:
    right = reader_right(request, caller)
    try:
        entries = await recording_service(request).in_thread(library.entries)
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error
    check_still(caller)
    found = [each for each in entries if right.sees(each.ended) and (not before or each.started < before)]
    return RecordingList(state=library.state(), recordings=found[:limit], older=max(0, len(found) - limit))


async def _open(request: Request, recording_id: str) -> tuple[RecordingReader, RecordingEntry]:
    service = recording_service(request)
    try:
        return await service.in_thread(lambda: service.library.open(recording_id))
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error


async def _with_reader(
    request: Request, recording_id: str, read: Callable[[RecordingReader, RecordingEntry], Result]
) -> Result:
    service = recording_service(request)

    def work() -> Result:
        reader, entry = service.library.open(recording_id)
        with reader:
            return read(reader, entry)

    try:
        return await service.in_thread(work)
    except (RecordingError, OSError) as error:
        raise recording_error(error) from error


def recording_error(error: RecordingError | OSError) -> ConsoleError:
    """Return the error to answer with. Damage is permanent; another reason may pass."""
    if isinstance(error, FileNotFoundError):
        return NotFound("it was deleted")
    if isinstance(error, RecordingError):
        return RecordingUnreadable(str(error))
    return RecordingFailed(f"it cannot be read: {error.strerror or error}")


def _bounded(
    reader: RecordingReader,
    first: int,
    last: int,
    topics: frozenset[str] | None,
    decodable: bool,
    right: RecordingReaderRight,
) -> Iterator[bytes]:
    """Yield the records. Ends early where the file is broken: the status is on its way already."""
    sent = 0
    try:
        for record in reader.records(first, last, topics, decodable=decodable):
            if not right.reads(reader.index.chunks[record.chunk].started):
                continue
            part = _framed(record)
            sent += len(part)
            if sent > MAX_BYTES:
                return
            yield part
    except (RecordingError, OSError):
        return
    finally:
        reader.close()


class _Head(msgspec.Struct, frozen=True, omit_defaults=True):
    topic: str
    event: int
    arrived: int  # µs since 1970
    captured: int
    keyframe: bool
    size: int
    format: str = ""  # of a picture: "h264", "vp8"; of sound: "opus", "g711-ulaw"


def _framed(record: Record) -> bytes:
    picture = record.picture
    medium = picture or record.sound
    payload = record.payload if medium is None else medium.data
    head = msgspec.json.encode(
        _Head(
            record.topic,
            record.event,
            record.arrived // 1000,
            record.captured // 1000,
            picture is None or picture.keyframe,
            len(payload),
            "" if medium is None else medium.format,
        )
    )
    return len(head).to_bytes(4, "big") + head + payload


def _json(answer: msgspec.Struct, status: int = 200) -> Response:
    body = msgspec.json.encode(answer)
    return Response(body, status, media_type="application/json", headers={"Cache-Control": "no-store"})
