"""Who resets a STOP, and what becomes of a reset."""

import asyncio
from typing import cast

import pytest

from lockstep.protocol.messages import Refusal, RefusalReason, Reset, Stop, StopState
from lockstep.server.control.stop import reset_service
from lockstep.server.errors import (
    ConsoleError,
    LockedOut,
    NoSeat,
    NotAllowed,
    ResetTooSoon,
    RobotLinkDown,
    StaleReset,
    TooManyRequests,
    Unconfirmed,
)
from lockstep.server.peers.peer import Peer
from tests.server.control.stop.stop_bench import StopBench, raised


async def test_a_reset_returns_when_the_robot_shows_that_it_is_released(bench: StopBench) -> None:
    bench.stopped(4)
    resetting = bench.reset("ann", 4)
    await asyncio.sleep(0)
    bench.stopped(4)
    assert not resetting.done()
    assert bench.robot.sent == [Reset(by="ann", number=4)]
    bench.show(StopState(number=4))
    await resetting
    (record,) = bench.records("reset")
    assert (record.who, record.detail) == ("ann", "stop 4")
    await bench.reset("ann", 4)  # a repeat is no second reset
    assert len(bench.robot.sent) == 1


@pytest.mark.parametrize(
    ("reason", "error"), [("stale_reset", StaleReset), ("too_soon", ResetTooSoon), ("locked_out", LockedOut)]
)
async def test_what_the_robot_refuses_is_an_error_of_that_name_and_in_the_audit(
    bench: StopBench, reason: RefusalReason, error: type[ConsoleError]
) -> None:
    bench.stopped(4)
    resetting = bench.reset("sue", 4)
    await asyncio.sleep(0)
    assert bench.resets.refused(Refusal(event=0, reason=reason, current=1, stop=4, detail="why"))
    assert await raised(resetting) is error
    assert [(each.who, each.what) for each in bench.records("reset")] == [("sue", f"http, refused {reason}")]


async def test_a_reset_never_passes_a_stop_that_has_no_answer_yet(bench: StopBench) -> None:
    bench.stopped(4)
    bench.press("olga", "p")
    assert await raised(bench.reset("ann", 4)) is StaleReset
    bench.take("p", 5)
    assert [type(each) for each in bench.robot.sent] == [Stop]


async def test_a_reset_of_the_stop_before_the_newest_is_stale_also_before_feedback_shows_the_newest(
    bench: StopBench,
) -> None:
    bench.show(StopState(stopped=False, number=4))  # it was reset
    bench.press("olga", "p")
    bench.take("p", 5)
    assert await raised(bench.reset("ann", 4)) is StaleReset
    assert [type(each) for each in bench.robot.sent] == [Stop]


async def test_a_stop_that_comes_while_a_reset_is_on_its_way_makes_that_stale(bench: StopBench) -> None:
    bench.stopped(4)
    resetting = bench.reset("ann", 4)
    await asyncio.sleep(0)
    bench.press("olga", "p")
    bench.stopped(5)
    assert await raised(resetting) is StaleReset


async def test_only_the_holder_of_the_seat_and_supervisors_reset(bench: StopBench) -> None:
    bench.stopped(4)
    assert await raised(bench.reset("olga", 4)) is NotAllowed
    assert await raised(bench.reset("bob", 4)) is NoSeat
    assert await raised(bench.reset("bob", 4, peer=True)) is NoSeat
    bench.holder = ""
    assert await raised(bench.reset("ann", 4)) is NoSeat
    assert bench.robot.sent == []
    tried = {(each.who, each.what) for each in bench.records("reset")}
    assert tried == {
        ("olga", "http, refused not_allowed"),
        ("bob", "http, refused no_seat"),
        ("ann", "http, refused no_seat"),
    }


async def test_resets_that_come_too_often_are_refused_for_their_link_and_for_the_robot(bench: StopBench) -> None:
    bench.stopped(4)
    for _ in range(reset_service.RESETS):
        assert await raised(bench.reset("sue", 3)) is StaleReset
    assert await raised(bench.reset("sue", 3)) is TooManyRequests
    for _ in range(reset_service.ROBOT_RESETS - reset_service.RESETS):
        assert await raised(bench.reset("ann", 3)) is StaleReset
    assert await raised(bench.reset("ann", 4)) is TooManyRequests
    bench.press("ann", "a")
    assert len(bench.robot.sent) == 1, "a stop is not limited"


async def test_without_a_link_and_without_an_answer_a_reset_says_so(
    bench: StopBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.stop.reset_attempts.PATIENCE", 0.01)
    monkeypatch.setattr(reset_service, "WATCH_SECONDS", 0.001)
    bench.stopped(4)
    assert await raised(bench.reset("ann", 4)) is Unconfirmed
    bench.lose()
    assert await raised(bench.reset("ann", 4)) is RobotLinkDown


async def test_a_peer_is_told_of_a_refused_reset_by_its_number_on_the_channel_that_it_came_from(
    bench: StopBench,
) -> None:
    bench.stopped(4)
    bench.resets.reset_by_peer(cast(Peer, bench.peers.all["olga"]), 4)
    (refusal,) = bench.heard("olga", Refusal)
    assert (refusal.reason, refusal.stop, refusal.event) == ("not_allowed", 4, 0)
    bench.resets.reset_by_peer(cast(Peer, bench.peers.all["ann"]), 4)
    bench.show(StopState(number=4))
    assert bench.heard("ann", Refusal) == []
