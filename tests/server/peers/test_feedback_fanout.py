import asyncio
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.peers.feedback_fanout import FeedbackFanout, FeedbackPace, FeedbackReceiver
from lockstep.server.util.cooperative_scheduler import SLICE


class FakePeer:
    def __init__(self) -> None:
        self.got: list[str] = []
        self.news = asyncio.Event()

    def send_feedback(self, text: str) -> None:
        self.got.append(text)
        self.news.set()


def _drives(peer: FeedbackReceiver) -> bool:
    return True


def test_the_first_feedback_is_due_at_once() -> None:
    pace = FeedbackPace(10)
    assert pace.wait(5.0) is None
    assert pace.take(5.0) is None
    pace.offer("a")
    assert pace.wait(5.0) == 0
    assert pace.take(5.0) == "a"


def test_in_between_the_newest_waits_its_turn() -> None:
    pace = FeedbackPace(10)
    pace.offer("a")
    pace.take(5.0)
    pace.offer("b")
    assert pace.wait(5.05) == pytest.approx(0.05)
    assert pace.take(5.05) is None
    pace.offer("c")
    assert pace.take(5.1001) == "c"


@pytest.mark.parametrize(("observers", "wait"), [(0, 0.1), (50, 0.1), (75, 0.15), (100, 0.2), (1000, 0.2)])
def test_many_observers_share_the_rate_down_to_half_of_it(observers: int, wait: float) -> None:
    pace = FeedbackPace(10)
    pace.share(observers)
    pace.offer("a")
    pace.take(5.0)
    pace.offer("b")
    assert pace.wait(5.0) == pytest.approx(wait)


@given(st.lists(st.floats(0, 0.3), min_size=2, max_size=60))
def test_no_more_than_the_rate_leaves_and_the_newest_never_starves(gaps: list[float]) -> None:
    pace, now, left = FeedbackPace(10), 1.0, []
    for number, gap in enumerate(gaps):
        now += gap
        pace.offer(str(number))
        if pace.take(now) is not None:
            left.append(now)
    for index in range(2, len(left)):
        assert left[index] - left[index - 2] >= 0.1 - 1e-9  # a late one may be followed sooner, never two
    assert pace.take(now + 0.2) is not None or left[-1] == now


async def test_whoever_drives_is_served_at_once_and_observers_by_the_task() -> None:
    operator, observers = FakePeer(), [FakePeer() for _ in range(5)]
    fanout = FeedbackFanout(1000, _drives, lambda: [operator], lambda: observers)
    task = asyncio.create_task(fanout.run())
    fanout.publish("a")
    assert operator.got == ["a"]
    assert observers[0].got == []
    async with asyncio.timeout(20):
        await observers[-1].news.wait()
    assert all(observer.got == ["a"] for observer in observers)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


class Expensive(FakePeer):
    """Sending to it takes longer than a slice."""

    def send_feedback(self, text: str) -> None:
        super().send_feedback(text)
        until = time.perf_counter() + SLICE
        while time.perf_counter() < until:
            pass


async def test_a_hundred_operators_who_do_not_drive_take_one_slice_of_a_turn_and_get_the_newest() -> None:
    driver, others = FakePeer(), [Expensive() for _ in range(100)]
    fanout = FeedbackFanout(1000, lambda peer: peer is driver, lambda: [*others, driver], list)
    fanout.publish("a")
    assert driver.got == ["a"]
    assert not any(other.got for other in others)
    await asyncio.sleep(0)
    assert [other.got for other in others] == [["a"]] + [[]] * 99
    fanout.publish("b")
    async with asyncio.timeout(20):
        while not all(other.got and other.got[-1] == "b" for other in others):  # noqa: ASYNC110
            await asyncio.sleep(0)
    assert driver.got == ["a", "b"]
    assert [len(other.got) for other in others] == [2] + [1] * 99


async def test_a_fault_of_one_operator_takes_feedback_from_no_other() -> None:
    class Broken(FakePeer):
        def send_feedback(self, text: str) -> None:
            raise RuntimeError("a fault of ours")

    caught: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: caught.append(context["exception"]))
    other = FakePeer()
    fanout = FeedbackFanout(1000, lambda peer: False, lambda: [Broken(), other], list)
    fanout.publish("a")
    async with asyncio.timeout(20):
        await other.news.wait()
    assert [str(each) for each in caught] == ["a fault of ours"]


async def test_a_turn_of_the_loop_serves_observers_until_the_slice_is_over() -> None:
    observers = [Expensive() for _ in range(3)]
    fanout = FeedbackFanout(1000, _drives, list, lambda: observers)
    task = asyncio.create_task(fanout.run())
    fanout.publish("a")
    steps = []
    while not observers[-1].got:
        await asyncio.sleep(0)
        steps.append(sum(len(observer.got) for observer in observers))
    assert sorted({0, *steps}) == [0, 1, 2, 3]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_failure_of_ours_ends_the_task_which_is_run_again() -> None:
    class Broken(FakePeer):
        def send_feedback(self, text: str) -> None:
            raise RuntimeError("a fault of ours")

    fanout = FeedbackFanout(1000, _drives, list, lambda: [Broken()])
    fanout.publish("a")
    async with asyncio.timeout(20):
        with pytest.raises(RuntimeError, match="a fault of ours"):
            await fanout.run()


async def test_an_observer_gets_the_newest_of_a_burst() -> None:
    observer = FakePeer()
    fanout = FeedbackFanout(50, _drives, list, lambda: [observer])
    task = asyncio.create_task(fanout.run())
    async with asyncio.timeout(20):
        fanout.publish("first")
        await observer.news.wait()
        observer.news.clear()
        for number in range(10):
            fanout.publish(str(number))
        await observer.news.wait()
    assert observer.got == ["first", "9"]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_relay_gets_feedback_once_for_all_its_watchers_as_an_observer_does() -> None:
    relay, observer = FakePeer(), FakePeer()
    fanout = FeedbackFanout(1000, _drives, list, lambda: [observer], [relay])
    task = asyncio.create_task(fanout.run())
    fanout.publish("a")
    async with asyncio.timeout(20):
        await observer.news.wait()
    assert (relay.got, observer.got) == (["a"], ["a"])
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
