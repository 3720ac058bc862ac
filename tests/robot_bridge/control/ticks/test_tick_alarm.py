import asyncio

from lockstep.robot_bridge.control.ticks.tick_alarm import TickAlarm

LONG = 3600.0  # s: only a ring ends such a wait within a test
TURN = 0.001  # s


async def ended_by_ring(alarm: TickAlarm, *, at_least: float = 0.0) -> None:
    async with asyncio.timeout(LONG / 10):
        await alarm.wait(LONG, at_least=at_least)


async def test_a_wait_without_a_ring_ends_with_its_time() -> None:
    await TickAlarm().wait(TURN, at_least=0.0)


async def test_a_ring_ends_the_wait() -> None:
    alarm = TickAlarm()
    asyncio.get_running_loop().call_soon(alarm.ring)
    await ended_by_ring(alarm)


async def test_a_ring_before_the_wait_ends_it_after_what_has_arrived_meanwhile() -> None:
    alarm, arrived = TickAlarm(), list[str]()
    alarm.ring()
    asyncio.get_running_loop().call_soon(arrived.append, "stop")
    await ended_by_ring(alarm)
    assert arrived == ["stop"]


async def test_a_ring_does_not_end_the_wait_before_its_least_time() -> None:
    alarm, order = TickAlarm(), list[str]()
    loop = asyncio.get_running_loop()
    alarm.ring()
    loop.call_later(TURN, order.append, "the least time runs")
    await ended_by_ring(alarm, at_least=TURN * 3)
    assert order == ["the least time runs"]


async def test_many_rings_end_one_wait() -> None:
    alarm = TickAlarm()
    for _ in range(1000):
        alarm.ring()
    await ended_by_ring(alarm)
    waits = asyncio.ensure_future(alarm.wait(LONG, at_least=0.0))
    for _ in range(10):
        await asyncio.sleep(0)
    assert not waits.done()
    waits.cancel()
    await asyncio.wait([waits])


async def test_a_wait_that_is_cancelled_leaves_the_alarm_usable() -> None:
    alarm = TickAlarm()
    waits = asyncio.ensure_future(alarm.wait(LONG, at_least=0.0))
    await asyncio.sleep(0)
    waits.cancel()
    await asyncio.wait([waits])
    alarm.ring()
    await ended_by_ring(alarm)


async def test_a_pause_ends_with_its_time_or_with_a_ring_which_ends_the_next_wait_too() -> None:
    alarm = TickAlarm()
    assert await alarm.pause(TURN)
    waits = asyncio.ensure_future(alarm.wait(LONG, at_least=0.0))
    await asyncio.sleep(0)
    assert not waits.done(), "the end of a pause is no ring"
    waits.cancel()
    await asyncio.wait([waits])
    asyncio.get_running_loop().call_soon(alarm.ring)
    async with asyncio.timeout(LONG / 10):
        assert not await alarm.pause(LONG)
        assert not await alarm.pause(LONG)
    await ended_by_ring(alarm)
