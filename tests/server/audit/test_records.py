"""What becomes a record, and with what."""

from itertools import count
from types import SimpleNamespace

import pytest

from lockstep.protocol.console import Seat, SeatClaim
from lockstep.protocol.messages import Feedback
from lockstep.server.audit import audit_trail
from lockstep.server.audit.audit_tail import KEPT, AuditTail
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import (
    BURST,
    CHATTER,
    MAX_BUDGETS,
    MAX_PENDING,
    RATE,
    Actor,
    AuditBudget,
    AuditKind,
    AuditMerger,
    AuditRecord,
)
from lockstep.server.event_clock import EventClock

ADA = Actor("Ada", "operator", "a1", "link1")
GRACE = Actor("Grace", "supervisor", "b2", "link2")


def _trail(tail: AuditTail | None = None) -> tuple[AuditTrail, AuditTail, EventClock]:
    kept = AuditTail() if tail is None else tail
    clock = EventClock()
    return AuditTrail(clock, kept), kept, clock


def _last(tail: AuditTail) -> AuditRecord:
    return list(tail)[-1]


def test_a_record_says_who_and_which_event_and_counts_up() -> None:
    trail, tail, clock = _trail()
    trail.record("start")
    clock.begin("e1")
    clock.observe(Feedback(event=7, issue=1, time=0.0, axes=[]), 0.0)
    trail.record("stop", ADA, "http", "a person came in")
    first, second = tail
    assert (first.n, first.epoch, first.event) == (1, "", 0)
    assert (second.n, second.epoch, second.event, second.kind) == (2, "e1", 7, "stop")
    assert (second.who, second.role, second.peer, second.link) == ADA
    assert (second.what, second.detail) == ("http", "a person came in")


def test_numbers_go_on_after_a_restart() -> None:
    trail, tail, _ = _trail(AuditTail([AuditRecord(n=41, time=0.0, kind="start")]))
    trail.record("start")
    assert _last(tail).n == 42


def test_hand_overs_name_both() -> None:
    trail, tail, _ = _trail()
    trail.seat(Seat(holder="a1", why="request"), ADA, ADA)
    trail.seat(Seat(holder="b2", why="taken"), GRACE, GRACE)
    assert (_last(tail).who, _last(tail).what, _last(tail).detail) == ("Grace", "taken", "was Ada (a1)")
    trail.seat(Seat(why="idle"), Actor(), Actor())
    assert (_last(tail).who, _last(tail).what) == ("Grace", "idle, free")


def test_claims_are_recorded_when_they_change_and_a_countdown_is_not() -> None:
    trail, tail, _ = _trail()
    trail.seat(Seat(holder="a1", why="request"), ADA, ADA)
    claims = [SeatClaim(peer="b2", name="Grace", seconds_left=60)]
    trail.seat(Seat(holder="a1", claims=claims), ADA, GRACE)
    trail.seat(Seat(holder="a1", claims=claims, idle_seconds_left=30), ADA, Actor())
    assert [(record.kind, record.who, record.detail) for record in tail][1:] == [("claim", "Grace", "Grace (b2)")]


def test_a_flood_of_refusals_becomes_one_record_for_each_peer_and_reason() -> None:
    trail, tail, _ = _trail()
    for _ in range(500):
        trail.refused(ADA, "no_seat")
    trail.refused(ADA, "late")
    trail.refused(GRACE, "no_seat")
    assert list(tail) == []
    trail.flush()
    assert {(record.who, record.what, record.count) for record in tail} == {
        ("Ada", "no_seat", 500),
        ("Ada", "late", 1),
        ("Grace", "no_seat", 1),
    }
    trail.flush()
    assert len(list(tail)) == 3


def test_what_is_merged_is_bounded() -> None:
    merger = AuditMerger()
    for number in range(MAX_PENDING + 5):
        merger.add("refusal", Actor(str(number)), "late")
    merger.add("refusal", Actor("0"), "late")
    found = list(merger.take())
    assert len(found) == MAX_PENDING + 1
    assert found[-1] == ("refusal", Actor(), "others", 5)
    assert found[0][3] == 2
    assert list(merger.take()) == []


def test_a_link_that_renames_itself_over_and_over_gets_one_record_a_minute_beyond_its_budget() -> None:
    trail, tail, _ = _trail()
    for number in range(2000):
        trail.record("renamed", ADA._replace(name=f"Ada {number}", peer=f"p{number % 20}"), detail="was Ada")
    alone = len(list(tail))
    assert BURST <= alone < BURST + 5
    trail.flush()
    assert len(list(tail)) == alone, "a minute is not over"
    trail.flush(beyond=True)
    beyond = _last(tail)
    assert (beyond.kind, beyond.link, beyond.count) == ("renamed", "link1", 2000 - alone)
    trail.record("renamed", GRACE, detail="was Grace")
    assert (_last(tail).who, _last(tail).count) == ("Grace", 1), "another link has a budget of its own"


def test_repeated_stops_draw_on_a_budget_and_a_first_stop_and_a_reset_never_do() -> None:
    trail, tail, _ = _trail()
    for _ in range(200):
        trail.again("stop", ADA, "stop, again")
        trail.flush()
    assert len(list(tail)) < BURST + 5
    before = len(list(tail))
    for _ in range(100):
        trail.record("stop", ADA, "http")
        trail.record("reset", ADA, "http")
    assert len(list(tail)) == before + 200


def test_a_pair_that_hands_the_seat_round_without_end_fills_nothing_and_who_keeps_it_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 1000.0
    monkeypatch.setattr(audit_trail, "time", SimpleNamespace(monotonic=lambda: now, time=lambda: now))
    trail, tail, _ = _trail()
    for _ in range(1000):
        trail.seat(Seat(holder="a1", why="request"), ADA, ADA)
        trail.seat(Seat(holder="b2", why="granted"), GRACE, ADA)
    trail.seat(Seat(holder="a1", why="request"), ADA, ADA)
    assert len(list(tail)) == 2 * BURST, "the first ones of each link have a record each"
    assert _last(tail).who == "Grace"
    trail.flush()
    assert _last(tail).who == "Grace", "of a change that came too soon nothing is written yet"
    now += 1.1 / RATE
    trail.flush()
    assert (_last(tail).kind, _last(tail).who, _last(tail).what) == ("seat", "Ada", "has it now")
    trail.flush(beyond=True)
    counted = {(record.link, record.what, record.count) for record in tail if record.detail == audit_trail.BEYOND}
    assert counted == {("link1", "request", 1001 - BURST), ("link2", "granted", 1000 - BURST)}
    trail.seat(Seat(why="released"), Actor(), ADA)
    now += 1.1 / RATE
    trail.flush()
    assert _last(tail).what == "free now"


def test_budgets_refill_and_their_number_is_bounded() -> None:
    budget = AuditBudget()
    while budget.take("joined", "link1", 0.0):
        pass
    assert not budget.take("joined", "link1", 0.9 / RATE)
    assert budget.take("left", "link1", 0.0), "each kind has its own"
    assert budget.take("joined", "link1", 1.1 / RATE)
    for number in range(2 * MAX_BUDGETS):
        budget.take("joined", f"other {number}", 0.0)
    assert not budget.take("joined", "one more", 0.0), "further links share one"
    budget.forget_idle(1e6)
    assert budget.take("joined", "one more", 1e6)


def test_refusals_renames_notes_and_joins_push_nothing_else_out_of_the_tail() -> None:
    tail = AuditTail()
    kinds: tuple[AuditKind, ...] = ("seat", "stop", "reset", "revocation", "invitation", "start")
    numbers = count(1)
    for kind in kinds:
        for _ in range(100):
            tail.append(AuditRecord(n=next(numbers), time=0.0, kind=kind, link="someone"))
    tail.append(AuditRecord(n=next(numbers), time=0.0, kind="refusal", link="quiet", what="late"))
    for _ in range(KEPT):
        for chatter in sorted(CHATTER):
            tail.append(AuditRecord(n=next(numbers), time=0.0, kind=chatter, link="loud"))
    kept = list(tail)
    assert len(kept) == KEPT
    assert [record.n for record in kept] == sorted(record.n for record in kept)
    for kind in kinds:
        assert sum(record.kind == kind for record in kept) == 100
    assert any(record.link == "quiet" for record in kept), "of a kind the loudest link gives way first"


def test_pages_backwards_find_all_that_is_kept_where_numbers_have_gaps() -> None:
    tail = AuditTail(AuditRecord(n=n, time=0.0, kind="note") for n in range(1, 10_000, 1000))
    assert [record.n for record in tail.before(9001, 3)] == [6001, 7001, 8001]
    assert [record.n for record in tail.before(6001, 500)] == [1, 1001, 2001, 3001, 4001, 5001]
    assert tail.before(1, 500) == []
    assert tail.next_number == 9002


def test_the_tail_gives_pages_and_the_newest_and_is_bounded() -> None:
    tail = AuditTail()
    assert (tail.next_number, tail.after(0, 5), tail.after(-1, 5)) == (1, [], [])
    for n in range(1, KEPT + 11):
        tail.append(AuditRecord(n=n, time=0.0, kind="note"))
    assert len(list(tail)) == KEPT
    assert [record.n for record in tail.after(0, 3)] == [11, 12, 13]
    assert [record.n for record in tail.after(100, 2)] == [101, 102]
    assert [record.n for record in tail.after(-1, 2)] == [KEPT + 9, KEPT + 10]
    assert tail.after(KEPT + 10, 2) == []
