import asyncio

from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.util.cooperative_scheduler import CooperativeScheduler
from tests.server.media.encoding.test_frame_queue import frame


class FakeTarget:
    """Sends one queued frame per call; `cost` seconds of the fake clock each."""

    def __init__(self, log: list[str], name: str, clock: "FakeClock", *, priority: bool = False, cost: float = 0.0):
        self.name = name
        self.priority = priority
        self.blocked = False
        self.frames: list[EncodedFrame] = []
        self.fault: Exception | None = None  # raised when it is served
        self.failures: list[Exception] = []
        self._log = log
        self._clock = clock
        self._cost = cost

    def put(self, frame: EncodedFrame) -> None:
        self.frames = [*self.frames, frame][-3:]

    def failed(self, error: Exception) -> None:
        self.failures.append(error)

    def send_next(self) -> bool:
        if self.fault is not None:
            raise self.fault
        if self.blocked or not self.frames:
            return False
        sent = self.frames.pop(0)
        self._clock.now += self._cost
        self._log.append(f"{self.name}{sent.stamp}")
        return bool(self.frames)


class FakeClock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


async def test_the_operator_is_served_within_publish_and_before_observers() -> None:
    log: list[str] = []
    clock = FakeClock()
    observers = [FakeTarget(log, f"observer{i}:", clock) for i in range(3)]
    operator = FakeTarget(log, "operator:", clock, priority=True)
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    fan_out.publish(frame(1), [*observers, operator])
    assert log == ["operator:1"]
    await asyncio.sleep(0)
    assert log == ["operator:1", "observer0:1", "observer1:1", "observer2:1"]


async def test_a_slice_is_bounded_and_the_next_one_goes_on_where_it_ended() -> None:
    log: list[str] = []
    clock = FakeClock()
    observers = [FakeTarget(log, f"{i}:", clock, cost=0.0004) for i in range(7)]
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    fan_out.publish(frame(1), observers)
    await asyncio.sleep(0)
    assert log == ["0:1", "1:1", "2:1"]
    await asyncio.sleep(0)
    assert log[3:] == ["3:1", "4:1", "5:1"]


async def test_a_blocked_observer_delays_nobody_and_is_tried_again_with_the_next_frame() -> None:
    log: list[str] = []
    clock = FakeClock()
    slow, quick = FakeTarget(log, "slow:", clock), FakeTarget(log, "quick:", clock)
    operator = FakeTarget(log, "operator:", clock, priority=True)
    slow.blocked = True
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    for i in range(1, 4):
        fan_out.publish(frame(i), [slow, quick, operator])
        await asyncio.sleep(0)
    assert log == ["operator:1", "quick:1", "operator:2", "quick:2", "operator:3", "quick:3"]
    slow.blocked = False
    fan_out.publish(frame(4), [slow])
    await asyncio.sleep(0)
    assert log[6:] == ["slow:2", "slow:3", "slow:4"]


async def test_a_forgotten_target_gets_nothing_more() -> None:
    log: list[str] = []
    clock = FakeClock()
    target = FakeTarget(log, "gone:", clock)
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    fan_out.publish(frame(1), [target])
    fan_out.forget(target)
    fan_out.forget(target)
    await asyncio.sleep(0)
    assert log == []


async def test_the_loop_gets_a_turn_between_slices() -> None:
    """With 100 observers of 0.5 ms each, work that becomes ready meanwhile waits for one slice at most."""
    log: list[str] = []
    clock = FakeClock()
    observers = [FakeTarget(log, f"{i}:", clock, cost=0.0005) for i in range(100)]
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    fan_out.publish(frame(1), observers)
    turns = []
    while len(log) < 100:
        before = len(log)
        await asyncio.sleep(0)  # one turn of the loop
        turns.append(len(log) - before)
    assert max(turns) <= 2


async def test_what_one_target_raises_is_told_to_it_once_and_takes_nothing_from_the_others() -> None:
    log: list[str] = []
    clock = FakeClock()
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    broken, broken_operator = (
        FakeTarget(log, "broken:", clock),
        FakeTarget(log, "broken operator:", clock, priority=True),
    )
    observers = [FakeTarget(log, "first:", clock), broken, FakeTarget(log, "last:", clock)]
    operator = FakeTarget(log, "operator:", clock, priority=True)
    broken.fault = broken_operator.fault = ValueError("planted")
    fan_out.publish(frame(1), [broken_operator, operator, *observers])
    await asyncio.sleep(0)
    assert log == ["operator:1", "first:1", "last:1"]
    assert len(broken.failures) == len(broken_operator.failures) == 1
    fan_out.forget(broken)
    fan_out.forget(broken_operator)
    fan_out.publish(frame(2), [operator, observers[0], observers[2]])
    await asyncio.sleep(0)
    assert log[3:] == ["operator:2", "first:2", "last:2"]


async def test_a_target_that_leaves_while_a_frame_is_handed_out_is_no_trouble_to_the_rest() -> None:
    """What `failed` does in earnest: the peer leaves every stream, and with it the targets that are gone through."""
    log: list[str] = []
    clock = FakeClock()
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    leaving, last = FakeTarget(log, "leaving:", clock, priority=True), FakeTarget(log, "last:", clock, priority=True)
    targets = {leaving: None, last: None}
    leaving.fault = ValueError("planted")
    leaving.failed = lambda error: targets.pop(leaving)  # type: ignore[method-assign]
    fan_out.publish(frame(1), targets)
    assert log == ["last:1"]


async def test_a_stream_whose_pacer_is_empty_again_is_served_the_operators_at_once_and_an_observers_in_its_turn() -> (
    None
):
    log: list[str] = []
    clock = FakeClock()
    operator, observer = FakeTarget(log, "operator:", clock, priority=True), FakeTarget(log, "observer:", clock)
    fan_out = FanOut(CooperativeScheduler(clock, 0.001))
    operator.blocked = observer.blocked = True
    fan_out.publish(frame(1), [operator, observer])
    await asyncio.sleep(0)
    operator.blocked = observer.blocked = False
    fan_out.serve_again(observer)
    fan_out.serve_again(operator)
    assert log == ["operator:1"]
    await asyncio.sleep(0)
    assert log == ["operator:1", "observer:1"]
