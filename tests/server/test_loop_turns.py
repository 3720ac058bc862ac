"""One piece of work for observers in each turn of the loop."""

import asyncio
from typing import Any

from server.loop_turns import LoopTurns, turns_of_loop


class Worker:
    """Has so many pieces to do, one whenever it is called."""

    def __init__(self, name: str, pieces: int, turns: LoopTurns, done: list[str]) -> None:
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
    turns, done = LoopTurns(), list[str]()
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
    turns, done = LoopTurns(), list[str]()
    Worker("much", 3, turns, done)
    Worker("little", 1, turns, done)
    for _ in range(5):
        await asyncio.sleep(0)
    assert done == ["much", "little", "much", "much"]


async def test_work_that_fails_takes_nobodys_turn() -> None:
    told: list[dict[str, Any]] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: told.append(context))
    turns, done = LoopTurns(), list[str]()

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


async def test_everything_on_one_loop_shares_its_turns() -> None:
    assert turns_of_loop() is turns_of_loop()


def test_each_loop_has_its_own() -> None:
    async def turns() -> LoopTurns:
        return turns_of_loop()

    assert asyncio.run(turns()) is not asyncio.run(turns())
