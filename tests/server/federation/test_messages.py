import json

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.audit.records import AuditRecord
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardInput, InputMalformed, InputNotSealed, InputTooLarge
from lockstep.server.federation.messages import (
    MAX_PUBLISHED,
    MAX_ROBOTS,
    Changed,
    Gone,
    News,
    Outcome,
    Published,
    Revoked,
    RevokedLink,
    SilencedLink,
    StopReply,
    StopRequest,
    pack_news,
    pack_published,
    pack_record,
    pack_revoked,
    unpack_news,
    unpack_published,
    unpack_record,
    unpack_revoked,
)
from lockstep.server.federation.robot_summary import MAX_PEOPLE, Person, Tile, within_bounds
from tests.server.federation.boards import KEY, tile

SEAL = Seal(KEY)
ID = "0123456789abcdef"
RECORD = AuditRecord(n=3, time=12.5, kind="stop", who="Ann", detail="line\nline \u2028 ä")
GOOD = within_bounds(tile("left", participants=(Person(name="Ann", role="operator", driving=True),)), "https://h")


@pytest.mark.parametrize(
    "news",
    [
        Changed(console=ID),
        Gone(console=ID),
        Revoked(console=ID),
        StopRequest(console=ID, request=ID, robots=("left",), by="Ann", role="operator", link="x", reason="smoke"),
        StopReply(console=ID, request=ID, robots=(Outcome(robot="left", delivered=True, event=4),)),
    ],
)
def test_news_come_out_as_they_went_in(news: News) -> None:
    assert unpack_news(SEAL, pack_news(SEAL, news)) == news


def test_what_a_console_shows_comes_out_as_it_went_in() -> None:
    published = Published(id=ID, name="one", n=9, robots=(GOOD,), silenced=(SilencedLink(id="x", until=9.5),))
    assert unpack_published(SEAL, pack_published(SEAL, published)) == published


def test_a_console_that_silences_nobody_or_says_more_than_is_known_here_is_understood() -> None:
    """Consoles of two versions may share a board."""
    told = msgspec.to_builtins(Published(id=ID, name="one", n=9, robots=(GOOD,)))
    del told["silenced"]
    assert unpack_published(SEAL, SEAL.put("console", json.dumps(told).encode())).silenced == ()
    assert unpack_published(SEAL, SEAL.put("console", json.dumps(told | {"new": [1]}).encode())).n == 9


def test_an_audit_record_is_the_very_line_of_the_file() -> None:
    fields = pack_record(SEAL, "one", "left", RECORD)
    assert json.loads(fields[b"line"]) == {
        "n": 3,
        "time": 12.5,
        "kind": "stop",
        "who": "Ann",
        "detail": "line\nline \u2028 ä",
    }
    found = unpack_record(SEAL, fields)
    assert (found.console, found.robot, found.record) == ("one", "left", RECORD)


def test_a_record_whose_robot_was_changed_is_refused() -> None:
    fields = pack_record(SEAL, "one", "left", RECORD) | {b"robot": b"right"}
    with pytest.raises(InputNotSealed):
        unpack_record(SEAL, fields)


def test_what_was_sealed_for_one_purpose_or_by_another_key_is_refused() -> None:
    link = RevokedLink(id="abc", expires=1.0)
    assert unpack_revoked(SEAL, pack_revoked(SEAL, link)) == link
    with pytest.raises(InputNotSealed):
        unpack_news(SEAL, pack_revoked(SEAL, link))
    with pytest.raises(InputNotSealed):
        unpack_revoked(Seal("another key"), pack_revoked(SEAL, link))


def test_what_is_too_large_is_refused_before_anything_looks_at_it() -> None:
    with pytest.raises(InputTooLarge):
        unpack_published(SEAL, SEAL.put("console", b" " * (MAX_PUBLISHED + 1)))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", "Left"),
        ("name", "left\n"),
        ("url", "javascript:alert(1)"),
        ("url", "https://ann:secret@h/"),
        ("url", "//h/robots/left/"),
        ("url", "https:///"),
        ("link", "sideways"),
        ("label", "x" * 61),
        ("event", -1),
        ("event", 2**31),
        ("event", "1"),
        ("event_rate", float("nan")),
        ("event_rate", 1e400),
        ("stopped", 1),
        ("participants", [{"name": "Ann", "role": "king"}]),
        ("participants", [{"name": "Ann", "role": "observer"}] * (MAX_PEOPLE + 1)),
        ("feedback_age_ms", -1.0),
    ],
)
def test_a_tile_beyond_its_bounds_is_refused_by_name(field: str, value: object) -> None:
    shown = json.loads(pack_published(SEAL, Published(id=ID, name="one", n=1, robots=(GOOD,)))[32:])
    shown["robots"][0][field] = value
    with pytest.raises(InputMalformed, match=rf"robots\.0\.{field}") as refused:
        unpack_published(SEAL, SEAL.put("console", json.dumps(shown).encode()))
    assert "secret" not in str(refused.value), "what was wrong, not the input"


def test_more_robots_than_a_console_may_have_are_refused() -> None:
    shown = Published(id=ID, name="one", n=1, robots=(GOOD,) * (MAX_ROBOTS + 1))
    with pytest.raises(InputMalformed):
        unpack_published(SEAL, pack_published(SEAL, shown))


def test_own_tiles_are_cut_to_what_others_take() -> None:
    long = "ä" * 1000
    people = (Person(name=long, role="observer"),) * 100
    wild = tile(
        "left", label=long, detail=long, stop_by=long, stop_reason=long, driver=long, claims=(long,) * 100,
        participants=people, faults=(long,) * 100, trouble=long, console=long,
    )  # fmt: skip
    shown = Published(id=ID, name="one", n=1, robots=(within_bounds(wild, "https://h"),))
    (found,) = unpack_published(SEAL, pack_published(SEAL, shown)).robots
    assert found.url == "https://h/robots/left/"
    assert found.console == ""


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200), st.sampled_from(["console", "news", "revoked"]), st.booleans())
def test_anything_else_is_refused_by_a_name(data: bytes, kind: str, sealed: bool) -> None:
    text = SEAL.put(kind, data) if sealed else data
    for unpack in (unpack_published, unpack_news, unpack_revoked):
        with pytest.raises(BoardInput):
            unpack(SEAL, text)
    line = {b"console": b"c", b"robot": b"left", b"line": data, b"seal": SEAL.of("audit", b"c\nleft\n" + data)}
    for missing in (*line, b""):
        with pytest.raises(BoardInput):
            unpack_record(SEAL, {key: value for key, value in line.items() if key != missing})


def test_fields_that_a_newer_console_adds_are_passed_over() -> None:
    shown = json.loads(pack_published(SEAL, Published(id=ID, name="one", n=1, robots=(GOOD,)))[32:])
    shown["robots"][0]["battery"] = 0.5
    found: tuple[Tile, ...] = unpack_published(SEAL, SEAL.put("console", json.dumps(shown).encode())).robots
    assert found == (GOOD,)
