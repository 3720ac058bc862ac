"""Who may read which part of a recording, and who may end one: the whole table."""

import math
from itertools import product

import pytest

from lockstep.protocol.console import Role
from lockstep.server.errors import NotAllowed
from lockstep.server.recording.format.event_index import ChunkEntry, EventEntry, EventIndex
from lockstep.server.recording.reading.bookmarks import Mark
from lockstep.server.recording.rights import RecordingReaderRight, check_end

SECOND = 1_000_000  # µs


def _index() -> EventIndex:
    """Ten chunks of a second each, with ten events each, from second 100 on."""
    starts = [(100 + number) * SECOND for number in range(10)]
    return EventIndex(
        started=starts[0],
        ended=110 * SECOND - 1,
        first_event=1,
        last_event=100,
        chunks=[ChunkEntry(at, 10 * at + 1, 10 * at + 10, start, start + 900_000) for at, start in enumerate(starts)],
        events=[EventEntry(10 * at + 1, start, at) for at, start in enumerate(starts)],
        keyframes={"/camera/front": [EventEntry(10 * at + 1, start, at) for at, start in enumerate(starts)]},
        marks=[Mark(event=10 * at + 1, time=start, kind="note", text=str(at)) for at, start in enumerate(starts)],
        counts={"/lockstep/feedback": 100},
    )


def _readable(right: RecordingReaderRight) -> list[int]:
    return [number for number, chunk in enumerate(_index().chunks) if right.reads(chunk.started)]


@pytest.mark.parametrize(
    ("role", "issued", "sees", "chunks"),
    [
        ("supervisor", 500.0, True, range(10)),
        ("supervisor", math.inf, True, range(10)),
        *((role, 50.0, True, range(10)) for role in ("observer", "operator")),
        *((role, 104.5, True, range(5, 10)) for role in ("observer", "operator")),
        *((role, 120.0, False, range(0)) for role in ("observer", "operator")),
        *((role, math.inf, False, range(0)) for role in ("observer", "operator")),
    ],
)
def test_a_link_reads_what_began_while_it_existed_and_a_supervisor_all(
    role: Role, issued: float, sees: bool, chunks: range
) -> None:
    right = RecordingReaderRight.of(role, issued)
    assert right.sees(_index().ended) == sees
    assert _readable(right) == list(chunks)
    if chunks:
        shown = right.part_of(_index())
        assert {event.chunk for event in shown.events} == set(chunks)
        assert {entry.chunk for entry in shown.keyframes["/camera/front"]} == set(chunks)
        assert [mark.text for mark in shown.marks] == [str(number) for number in chunks]
        assert (shown.started, shown.first_event) == ((100 + chunks[0]) * SECOND, 10 * chunks[0] + 1)
        assert shown.chunks == _index().chunks, "numbers of chunks stay"
    else:
        with pytest.raises(NotAllowed):
            right.part_of(_index())


def test_a_whole_file_is_for_links_that_existed_when_it_began() -> None:
    RecordingReaderRight.of("operator", 99.0).check_reads(100 * SECOND)
    with pytest.raises(NotAllowed):
        RecordingReaderRight.of("operator", 101.0).check_reads(100 * SECOND)
    RecordingReaderRight.of("supervisor", 101.0).check_reads(100 * SECOND)


def test_an_automatic_recording_is_ended_from_the_seat_or_by_a_supervisor() -> None:
    roles: tuple[Role, ...] = ("observer", "operator", "supervisor")
    allowed = set()
    for role, automatic, holds_seat in product(roles, (False, True), (False, True)):
        try:
            check_end(role, automatic=automatic, holds_seat=holds_seat)
        except NotAllowed:
            continue
        allowed.add((role, automatic, holds_seat))
    assert allowed == {
        *(("supervisor", automatic, holds) for automatic, holds in product((False, True), (False, True))),
        *(("operator", False, holds) for holds in (False, True)),
        ("operator", True, True),
    }
