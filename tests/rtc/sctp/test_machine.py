"""Any order of events, found by hypothesis: two associations over a bad network, and one against a hostile peer."""

import contextlib
from collections.abc import Callable
from itertools import count

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lockstep.rtc.sctp import (
    Association,
    AssociationClosed,
    Closed,
    MessageReceived,
    MessageTooLarge,
    SctpSettings,
    SendQueueFull,
    State,
)
from lockstep.rtc.sctp.wire.chunks import (
    Abort,
    Chunk,
    CookieAck,
    CookieEcho,
    Data,
    Error,
    ForwardTsn,
    Heartbeat,
    HeartbeatAck,
    Init,
    InitAck,
    InterleavedData,
    InterleavedForwardTsn,
    Reconfig,
    Sack,
    Shutdown,
    ShutdownAck,
    ShutdownComplete,
    Skip,
    Unknown,
)
from tests.rtc.sctp.hostile import Victim
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import Link, World, seeded

pytestmark = pytest.mark.slow


def near_the_wrap(seed: int) -> Callable[[int], bytes]:
    """Random bytes that make the first TSN 2^32 - 3."""
    random, drawn = seeded(seed), count()
    return lambda size: b"\xff\xff\xff\xfd" if next(drawn) == 2 else random(size)


class TwoAssociations(RuleBasedStateMachine):
    """What was sent reliably arrives once, in order on each stream, when the network lets it."""

    def __init__(self) -> None:
        super().__init__()
        self.ends: list[Association] = []
        for seed in (1, 2):
            self.ends.append(Association(SctpSettings(send_queue=40_000), near_the_wrap(seed)))
        self.world = World(self.ends[0], self.ends[1])
        self.sent: list[dict[int, list[bytes]]] = [{}, {}]
        self.got: list[dict[int, list[bytes]]] = [{}, {}]
        self.number = 0
        for end in self.ends:
            end.start(0.0)

    def message(self, size: int) -> bytes:
        self.number += 1
        return self.number.to_bytes(4, "big") + bytes(size)

    @rule(
        end=st.integers(0, 1), stream=st.integers(0, 2), size=st.sampled_from([0, 100, 1127, 1128, 1132, 5000, 16380])
    )
    def send_in_order(self, end: int, stream: int, size: int) -> None:
        payload = self.message(size)
        try:
            self.ends[end].send(stream, 53, payload, self.world.now)
        except SendQueueFull:
            return
        self.sent[end].setdefault(stream, []).append(payload)

    @rule(end=st.integers(0, 1), count=st.integers(1, 30), size=st.integers(0, 3000))
    def send_newest_wins(self, end: int, count: int, size: int) -> None:
        for _ in range(count):
            payload = self.message(size)
            self.ends[end].send(10, 53, payload, self.world.now, ordered=False, max_retransmits=0)

    @rule(end=st.integers(0, 1), size=st.sampled_from([10, 3000]), limit=st.integers(0, 2))
    def send_in_order_but_give_up(self, end: int, size: int, limit: int) -> None:
        with contextlib.suppress(SendQueueFull):
            self.ends[end].send(11, 53, self.message(size), self.world.now, max_retransmits=limit)

    @rule(
        index=st.integers(0, 1),
        delay=st.sampled_from([0.001, 0.05, 0.5, 2.0]),
        jitter=st.sampled_from([0.0, 0.1]),
        loss=st.sampled_from([0.0, 0.05, 0.3, 1.0]),
        duplication=st.sampled_from([0.0, 0.3]),
    )
    def change_the_network(self, index: int, delay: float, jitter: float, loss: float, duplication: float) -> None:
        links = list(self.world.links)
        links[index] = Link(delay, jitter, loss, duplication)
        self.world.links = (links[0], links[1])

    @rule(seconds=st.sampled_from([0.001, 0.02, 0.2, 1.0, 7.0]))
    def let_time_pass(self, seconds: float) -> None:
        self.world.run(self.world.now + seconds)
        self.collect()

    def collect(self) -> None:
        for index, end in enumerate(self.ends):
            for event in end.events():
                assert not isinstance(event, Closed), event
                if isinstance(event, MessageReceived):
                    self.got[1 - index].setdefault(event.stream, []).append(event.payload)

    @invariant()
    def memory_is_bounded(self) -> None:
        for end in self.ends:
            assert Internals(end).held <= 2 * end.settings.receive_window
            assert Internals(end).outstanding <= end.settings.max_outstanding + 20

    @invariant()
    def what_arrives_was_sent_in_this_order(self) -> None:
        for sent, got in zip(self.sent, self.got, strict=True):
            for stream in (0, 1, 2):
                arrived = got.get(stream, [])
                assert arrived == sent.get(stream, [])[: len(arrived)]
            for stream in (10, 11):
                arrived = got.get(stream, [])
                assert len(set(arrived)) == len(arrived)
            assert got.get(11, []) == sorted(got.get(11, []))

    def teardown(self) -> None:
        self.world.links = (Link(), Link())
        self.world.run(self.world.now + 300.0, stop=lambda: all(Internals(end).is_idle for end in self.ends))
        self.world.run(self.world.now + 5.0)
        self.collect()
        for sent, got in zip(self.sent, self.got, strict=True):
            for stream in (0, 1, 2):
                assert got.get(stream, []) == sent.get(stream, [])
        for end in self.ends:
            assert end.state is State.ESTABLISHED
            assert Internals(end).flight == Internals(end).newest_flight == 0
            assert Internals(end).held == 0


TestTwoAssociations = TwoAssociations.TestCase
TestTwoAssociations.settings = settings(
    max_examples=40, stateful_step_count=25, deadline=None, suppress_health_check=list(HealthCheck)
)

U16, U32 = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
NEAR = st.integers(-3, 40)  # around the number that would be right
STREAM = st.sampled_from([0, 1, 2, 3, 500, 1023, 1024, 65535])
PAYLOAD = st.sampled_from([b"", b"x", b"\x02", b"\xff\xfe", b"\x03\x00" + bytes(10), bytes(1132)])
PPID = st.sampled_from([0, 50, 51, 53, 54, 56, 57])
BODIES = st.binary(max_size=40)
PARAMETERS = st.lists(st.tuples(st.sampled_from([1, 7, 8, 12, 13, 14, 15, 16, 17, 18, 0x8008, 0xC000, 0x4001]), BODIES))
INIT = (U32, U32, U16, U16, U32, PARAMETERS)


def chunks(victim: Victim) -> st.SearchStrategy[Chunk]:
    tsn = NEAR.map(lambda near: (victim.tsn + near) & 0xFFFFFFFF) | U32
    own = NEAR.map(lambda near: (victim.theirs - near) & 0xFFFFFFFF) | U32
    flags, small = st.integers(0, 15), st.integers(0, 5)
    skips = st.lists(st.builds(Skip, STREAM, small | U16, st.booleans()), max_size=20)
    return st.one_of(
        st.builds(Data, tsn, flags, STREAM, small | U16, PPID, PAYLOAD),
        st.builds(InterleavedData, tsn, flags, STREAM, small | U32, small, PPID, PAYLOAD),
        st.builds(Sack, own, U32, st.lists(st.tuples(U16 | small, U16 | small)), st.lists(own)),
        st.builds(ForwardTsn, tsn, skips),
        st.builds(InterleavedForwardTsn, tsn, skips),
        st.builds(Reconfig, PARAMETERS),
        st.builds(Heartbeat, BODIES),
        st.builds(HeartbeatAck, BODIES),
        st.builds(Error, PARAMETERS),
        st.builds(CookieEcho, BODIES),
        st.just(CookieAck()),
        st.builds(Init, *INIT),
        st.builds(InitAck, *INIT),
        st.builds(Unknown, st.integers(0, 255), st.integers(0, 255), BODIES),
        st.one_of(
            st.builds(Abort, PARAMETERS, st.booleans()),
            st.builds(Shutdown, tsn),
            st.just(ShutdownAck()),
            st.builds(ShutdownComplete, st.booleans()),
        ),
    )


class HostilePeer(RuleBasedStateMachine):
    """`Victim` asserts the bounds after each packet."""

    interleaving = False

    def __init__(self) -> None:
        super().__init__()
        self.victim = Victim(interleaving=self.interleaving)

    @rule(data=st.data())
    def say_something(self, data: st.DataObject) -> None:
        self.victim.say(*data.draw(st.lists(chunks(self.victim), min_size=1, max_size=4)))

    @rule(first=NEAR, count=st.integers(1, 200), step=st.integers(1, 3), flags=st.integers(0, 7), payload=PAYLOAD)
    def say_much(self, first: int, count: int, step: int, flags: int, payload: bytes) -> None:
        for number in range(count):
            tsn = (self.victim.tsn + first + number * step) & 0xFFFFFFFF
            if self.interleaving:
                self.victim.say(InterleavedData(tsn, flags, 0, 0, number, 51, payload))
            else:
                self.victim.say(Data(tsn, flags, 0, number & 0xFFFF, 51, payload))

    @rule(bytes_=st.binary(min_size=4, max_size=100))
    def say_nonsense(self, bytes_: bytes) -> None:
        self.victim.say_raw(bytes_)

    @rule(seconds=st.sampled_from([0.01, 0.2, 3.0, 40.0]))
    def wait(self, seconds: float) -> None:
        self.victim.wait(seconds)

    @precondition(lambda self: self.victim.end.association.state is State.ESTABLISHED)
    @rule(size=st.integers(1, 16_384), newest=st.booleans())
    def send_to_it(self, size: int, newest: bool) -> None:
        association = self.victim.end.association
        with contextlib.suppress(SendQueueFull, MessageTooLarge, AssociationClosed):
            association.send(
                1, 53, bytes(size), self.victim.now, ordered=not newest, max_retransmits=0 if newest else None
            )
        self.victim.wait(0.0)


class InterleavingHostilePeer(HostilePeer):
    interleaving = True


TestHostilePeer = HostilePeer.TestCase
TestInterleavingHostilePeer = InterleavingHostilePeer.TestCase
TestHostilePeer.settings = TestInterleavingHostilePeer.settings = settings(
    max_examples=60, stateful_step_count=25, deadline=None, suppress_health_check=list(HealthCheck)
)
