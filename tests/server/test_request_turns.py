"""One request in each turn of the loop, addresses in turn."""

import asyncio

from server.request_turns import RequestTurns


class Rig:
    def __init__(self) -> None:
        self.turns = RequestTurns()
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
    turns = RequestTurns()
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
