"""One datagram of each in turn, a slice at a time."""

import asyncio

from lockstep.server.util.cooperative_scheduler import CooperativeScheduler
from lockstep.server.webrtc.datagram_queue import DatagramQueue, DriverQueue


class Peer:
    """Whose datagrams wait; handling one takes a millisecond of the test's clock."""

    def __init__(self, name: str, count: int, world: "World") -> None:
        self.name = name
        self.left = count
        self._world = world

    def handle_next(self) -> bool:
        self.left -= 1
        self._world.now += 0.001
        self._world.handled.append(self.name)
        return self.left > 0


class World:
    def __init__(self) -> None:
        self.now = 0.0
        self.handled: list[str] = []


async def turns_of_the_loop(count: int) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


async def test_everybody_has_a_turn_before_anybody_has_a_second() -> None:
    world = World()
    turns = DatagramQueue(CooperativeScheduler(lambda: world.now, 1.0))
    for peer in (Peer("flood", 5, world), Peer("a", 1, world), Peer("b", 2, world)):
        turns.add(peer)
    assert world.handled == []  # never in the turn of the loop that they came in
    await turns_of_the_loop(2)
    assert world.handled == ["flood", "a", "b", "flood", "b", "flood", "flood", "flood"]


async def test_a_turn_of_the_loop_handles_no_more_than_a_slice() -> None:
    world = World()
    turns = DatagramQueue(CooperativeScheduler(lambda: world.now, 0.0035))
    turns.add(Peer("flood", 10, world))
    between: list[int] = []
    while len(world.handled) < 10:
        await asyncio.sleep(0)
        between.append(len(world.handled))
    assert between == [4, 8, 10]


async def test_who_is_added_again_has_one_place() -> None:
    world = World()
    turns = DatagramQueue(CooperativeScheduler(lambda: world.now, 1.0))
    peer = Peer("a", 1, world)
    for _ in range(3):
        turns.add(peer)
    await turns_of_the_loop(3)
    assert world.handled == ["a"]
    peer.left = 1
    turns.add(peer)
    await turns_of_the_loop(2)
    assert world.handled == ["a", "a"]


async def test_what_a_driver_sends_is_handled_at_once_and_of_others_who_may_drive_so_much() -> None:
    world = World()
    may_go = [True, False]
    turns = DriverQueue(DatagramQueue(CooperativeScheduler(lambda: world.now, 1.0)), lambda: may_go.pop(0))
    assert turns.may_go_at_once()
    assert not turns.may_go_at_once()
    turns.drives = True
    assert turns.may_go_at_once(), "the bound is for those who do not drive"
    turns.add(Peer("a", 1, world))
    await turns_of_the_loop(2)
    assert world.handled == ["a"]
