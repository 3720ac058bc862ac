"""One request in each turn of the loop, addresses in turn."""

import asyncio
from functools import partial

from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.util.fair_queue import FairQueue


class Rig:
    def __init__(self) -> None:
        self.turns = FairQueue()
        self.served: list[str] = []

    async def request(self, address: str, name: str) -> None:
        await self.turns.take(address)
        self.served.append(name)

    def begin(self, *names: str) -> list[asyncio.Task[None]]:
        """`names`: "a1" is a request from address "a"."""
        return [asyncio.create_task(self.request(name[0], name)) for name in names]


async def turns_of_the_loop(count: int) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


async def test_a_request_alone_does_not_wait() -> None:
    turns = FairQueue()
    waiting = turns.take("a")
    try:
        waiting.send(None)
    except StopIteration:
        return
    raise AssertionError("it waited")


async def test_a_salvo_is_served_one_in_each_turn_so_that_others_come_in_between() -> None:
    rig = Rig()
    tasks = rig.begin("a1", "a2", "a3", "a4")
    most, before = 0, 0
    while len(rig.served) < 4:
        await turns_of_the_loop(1)
        most, before = max(most, len(rig.served) - before), len(rig.served)
    await asyncio.gather(*tasks)
    assert most == 1
    assert rig.served == ["a1", "a2", "a3", "a4"]


async def test_addresses_take_turns_so_that_who_asks_much_waits_for_himself() -> None:
    rig = Rig()
    tasks = rig.begin("a1", "a2", "a3", "a4", "b1", "c1")
    await asyncio.gather(*tasks)
    assert rig.served == ["a1", "a2", "b1", "c1", "a3", "a4"]


async def test_who_is_gone_before_his_turn_holds_up_nobody() -> None:
    rig = Rig()
    tasks = rig.begin("a1", "a2", "a3")
    await turns_of_the_loop(1)
    tasks[1].cancel()
    await asyncio.wait(tasks)
    assert rig.served == ["a1", "a3"]
    await turns_of_the_loop(2)
    await test_a_request_alone_does_not_wait()


async def test_what_is_first_comes_before_a_salvo_that_waits() -> None:
    rig = Rig()
    tasks = rig.begin("a1", "a2", "a3", "b1")
    await turns_of_the_loop(1)

    async def stop() -> None:
        await rig.turns.take("z", first=True)
        rig.served.append("stop")

    await asyncio.gather(*tasks, asyncio.create_task(stop()))
    assert rig.served.index("stop") <= 2
    assert sorted(rig.served) == ["a1", "a2", "a3", "b1", "stop"]


async def test_a_pace_holds_all_back_but_what_is_first() -> None:
    """Two pieces at once, the next when the budget has one again: never, in this test."""
    turns = FairQueue(TokenBucket(1e-6, 2))
    done: list[str] = []
    for name in ("a", "b", "c", "d"):
        turns.ask("x", partial(done.append, name))
    await turns_of_the_loop(20)
    assert done == ["a", "b"]
    turns.ask("x", partial(done.append, "stop"), first=True)
    await turns_of_the_loop(2)
    assert done == ["a", "b", "stop"]


async def test_what_the_pace_held_back_comes_when_there_is_budget_again() -> None:
    turns, served = FairQueue(TokenBucket(1000.0, 1)), asyncio.Event()
    turns.ask("x", lambda: None)
    turns.ask("x", served.set)
    async with asyncio.timeout(20):
        await served.wait()


async def test_work_that_raises_holds_up_nobody() -> None:
    turns, done = FairQueue(), list[str]()
    asyncio.get_running_loop().set_exception_handler(lambda _, context: done.append(str(context["exception"])))

    def fail() -> None:
        raise ValueError("planted")

    turns.ask("a", lambda: None)
    turns.ask("a", fail)
    turns.ask("a", partial(done.append, "after"))
    await turns_of_the_loop(5)
    assert done == ["planted", "after"]


async def test_a_beginning_gets_every_third_turn_however_many_others_wait() -> None:
    rig = Rig()

    async def begin(name: str) -> None:
        await rig.turns.begin()
        rig.served.append(name)

    tasks = [*rig.begin("a1", "b1", "c1", "d1", "e1"), *(asyncio.create_task(begin(name)) for name in ("x1", "x2"))]
    await asyncio.gather(*tasks)
    assert rig.served == ["a1", "b1", "c1", "x1", "d1", "e1", "x2"]


async def test_a_beginning_keeps_to_the_pace_and_comes_when_there_is_budget_again() -> None:
    turns = FairQueue(TokenBucket(20, 1))
    async with asyncio.timeout(20):
        await turns.begin()
        waiting = asyncio.create_task(turns.begin())
        await turns_of_the_loop(5)
        assert not waiting.done()
        await waiting
