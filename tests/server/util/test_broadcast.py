import asyncio

from lockstep.server.util.broadcast import Broadcast


async def test_everybody_who_waits_is_woken_and_whoever_waits_afterwards_waits_for_the_next() -> None:
    news = Broadcast()
    woken = list[str]()

    async def wait(name: str) -> None:
        await news.wait()
        woken.append(name)

    async with asyncio.TaskGroup() as tasks:
        for name in ("a", "b"):
            tasks.create_task(wait(name))
        await asyncio.sleep(0)
        news.send()
        tasks.create_task(wait("later"))
        for _ in range(3):
            await asyncio.sleep(0)
        assert woken == ["a", "b"]
        news.send()
    assert woken == ["a", "b", "later"]
