import asyncio

import pytest

from lockstep.client.media.newest_queue import NewestQueue, QueueClosed, Readers


async def test_a_full_queue_loses_its_oldest_item_and_counts_it() -> None:
    queue: NewestQueue[int] = NewestQueue(2)
    for item in (1, 2, 3):
        queue.put(item)
    assert [await queue.get(), await queue.get()] == [2, 3]
    assert queue.dropped == 1


async def test_a_reader_wakes_when_an_item_comes() -> None:
    queue: NewestQueue[int] = NewestQueue(2)
    async with asyncio.TaskGroup() as group, asyncio.timeout(20):
        reader = group.create_task(queue.get())
        await asyncio.sleep(0)
        queue.put(7)
    assert reader.result() == 7


async def test_a_closed_queue_gives_out_what_it_has_and_ends() -> None:
    queue: NewestQueue[int] = NewestQueue(2)
    queue.put(1)
    queue.close()
    queue.put(2)
    assert await queue.get() == 1
    with pytest.raises(QueueClosed):
        await queue.get()


async def test_a_waiting_reader_ends_with_the_queue() -> None:
    queue: NewestQueue[int] = NewestQueue(2)
    async with asyncio.TaskGroup() as group, asyncio.timeout(20):
        reader = group.create_task(_closed(queue))
        await asyncio.sleep(0)
        queue.close()
    assert reader.result()


async def _closed(queue: NewestQueue[int]) -> bool:
    try:
        await queue.get()
    except QueueClosed:
        return True
    return False


async def test_what_is_cleared_counts_as_dropped() -> None:
    queue: NewestQueue[int] = NewestQueue(3)
    queue.put(1)
    queue.put(2)
    assert queue.clear() == 2
    assert (len(queue), queue.dropped) == (0, 2)


async def test_each_reader_has_its_own_pace_and_what_they_lost_is_counted_after_they_are_gone() -> None:
    readers: Readers[int] = Readers()
    with readers.open(1) as slow, readers.open(2) as quick:
        readers.put(1)
        readers.put(2)
        assert [await slow.get(), await quick.get(), await quick.get()] == [2, 1, 2]
        assert (len(readers), readers.dropped) == (2, 1)
    assert (len(readers), readers.dropped) == (0, 1)


async def test_readers_of_a_closed_source_end_also_later_ones() -> None:
    readers: Readers[int] = Readers()
    with readers.open(2) as early:
        readers.close()
        with pytest.raises(QueueClosed):
            await early.get()
    with readers.open(2) as late, pytest.raises(QueueClosed):
        await late.get()
