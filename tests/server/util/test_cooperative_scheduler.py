"""One slice of work for observers in each turn of the loop, until somebody comes who must not wait."""

import asyncio
import gc
import socket
import threading
import weakref
from collections.abc import Iterator
from typing import Any

import pytest

from lockstep.server.util.cooperative_scheduler import CooperativeScheduler, turns_of_loop

Pair = tuple[socket.socket, socket.socket]


@pytest.fixture
def pair() -> Iterator[Pair]:
    here, there = socket.socketpair()
    with here, there:
        yield here, there


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


class Worker:
    """Has so many pieces to do, one whenever it is called."""

    def __init__(self, name: str, pieces: int, turns: CooperativeScheduler, done: list[str]) -> None:
        self._name = name
        self._left = pieces
        self._turns = turns
        self._done = done
        turns.ask(self)

    def __call__(self) -> None:
        self._left -= 1
        self._done.append(self._name)
        if self._left:
            self._turns.ask(self)


async def test_a_turn_of_the_loop_has_one_piece_of_whatever_kind() -> None:
    turns, done = CooperativeScheduler(), list[str]()
    for name in ("pictures", "datagrams", "feedback"):
        Worker(name, 4, turns, done)
    assert done == []  # never in the turn that asks
    lengths = []
    while len(done) < 12:
        await asyncio.sleep(0)
        lengths.append(len(done))
    assert lengths == list(range(1, 13))
    assert done == ["pictures", "datagrams", "feedback"] * 4


async def test_who_asks_again_comes_after_all_who_wait() -> None:
    turns, done = CooperativeScheduler(), list[str]()
    Worker("much", 3, turns, done)
    Worker("little", 1, turns, done)
    for _ in range(5):
        await asyncio.sleep(0)
    assert done == ["much", "little", "much", "much"]


async def test_work_that_fails_takes_nobodys_turn() -> None:
    told: list[dict[str, Any]] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: told.append(context))
    turns, done = CooperativeScheduler(), list[str]()

    def fail() -> None:
        raise RuntimeError("a fault of ours")

    turns.ask(fail)
    Worker("next", 1, turns, done)
    for _ in range(3):
        await asyncio.sleep(0)
    assert done == ["next"]
    assert [str(context["exception"]) for context in told] == ["a fault of ours"]
    turns.ask(fail)  # alone: the queue is empty when it fails
    await asyncio.sleep(0)
    Worker("later", 1, turns, done)
    await asyncio.sleep(0)
    assert done == ["next", "later"]


async def test_a_slice_is_over_when_its_time_has_passed() -> None:
    clock, seen = Clock(), list[bool]()
    turns = CooperativeScheduler(clock, 0.002)

    def work() -> None:
        for clock.now in (5.0, 5.0019, 5.0021):
            seen.append(turns.is_over())

    clock.now = 5.0
    turns.ask(work)
    await asyncio.sleep(0)
    assert seen == [False, False, True]


async def test_a_slice_is_over_when_there_is_something_to_read_where_nobody_may_wait(pair: Pair) -> None:
    here, there = pair
    turns, seen = CooperativeScheduler(Clock()), list[bool]()
    turns.yield_to(here)
    turns.yield_to(here)  # again: nothing new

    def work() -> None:
        seen.append(turns.is_over())
        there.send(b"a command")
        seen.append(turns.is_over())
        here.recv(100)
        seen.append(turns.is_over())

    turns.ask(work)
    await asyncio.sleep(0)
    assert seen == [False, True, False]


async def test_a_socket_that_is_closed_ends_no_slice(pair: Pair) -> None:
    here, there = pair
    turns, seen = CooperativeScheduler(Clock()), list[bool]()
    turns.yield_to(here)
    there.send(b"unread")
    here.close()
    turns.yield_to(here)  # closed already
    turns.ask(lambda: seen.append(turns.is_over()))
    await asyncio.sleep(0)
    assert seen == [False]


async def test_a_call_from_a_thread_ends_every_slice_until_it_is_done() -> None:
    turns, done = CooperativeScheduler(Clock()), list[str]()

    def work() -> None:
        if turns.is_over():
            done.append("over already")
        thread = threading.Thread(target=turns.call_from_thread, args=(lambda: done.append("called"),))
        thread.start()
        thread.join()
        done.append("over" if turns.is_over() else "goes on")

    turns.ask(work)
    turns.ask(lambda: done.append("still over" if turns.is_over() else "a slice of its own"))
    for _ in range(3):
        await asyncio.sleep(0)
    assert done == ["over", "still over", "called"]


async def test_calls_from_threads_keep_their_order() -> None:
    turns, done = CooperativeScheduler(), list[int]()

    def work() -> None:
        for number in range(100):
            turns.call_from_thread(lambda number=number: done.append(number))  # type: ignore[misc]

    await asyncio.to_thread(work)
    for _ in range(3):
        await asyncio.sleep(0)
    assert done == list(range(100))


async def test_busy_is_the_time_in_which_work_waits_or_is_done() -> None:
    clock = Clock()
    turns = CooperativeScheduler(clock)

    def work() -> None:
        clock.now += 1.0
        if clock.now < 3.5:
            turns.ask(work)

    clock.now = 0.5
    assert turns.busy_seconds == 0.0
    turns.ask(work)
    clock.now = 1.5  # it has waited for a second
    assert turns.busy_seconds == 1.0
    for _ in range(3):
        await asyncio.sleep(0)
    assert clock.now == 3.5
    clock.now = 100.0
    assert turns.busy_seconds == 3.0


async def test_everything_on_one_loop_shares_its_turns() -> None:
    assert turns_of_loop() is turns_of_loop()


def test_each_loop_has_its_own() -> None:
    async def turns() -> CooperativeScheduler:
        return turns_of_loop()

    assert asyncio.run(turns()) is not asyncio.run(turns())


def test_a_loop_that_ended_is_not_kept() -> None:
    async def here() -> weakref.ref[asyncio.AbstractEventLoop]:
        turns_of_loop()
        return weakref.ref(asyncio.get_running_loop())

    ended = asyncio.run(here())
    gc.collect()
    assert ended() is None


def test_a_thread_that_outlives_the_loop_is_told() -> None:
    async def turns() -> CooperativeScheduler:
        return CooperativeScheduler()

    left = asyncio.run(turns())
    gc.collect()
    with pytest.raises(RuntimeError):
        left.call_from_thread(lambda: None)
