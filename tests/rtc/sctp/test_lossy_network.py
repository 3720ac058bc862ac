"""Every reliable message once and in order, whatever the network does."""

from itertools import pairwise

import pytest

from lockstep.rtc.sctp import Association, Closed, MessageReceived, SctpSettings, State
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import Link, World, associated, seeded

pytestmark = pytest.mark.slow

ORDERED, UNORDERED, NEWEST, TIMED, BULK = range(5)

NETWORKS = {
    "clean": Link(delay=0.05),
    "5 % loss": Link(delay=0.05, loss=0.05),
    "30 % loss": Link(delay=0.05, loss=0.3),
    "reordered": Link(delay=0.02, jitter=0.1),
    "duplicated": Link(delay=0.05, jitter=0.02, duplication=0.3),
    "bursts": Link(delay=0.05, burst=0.03),
    "slow": Link(delay=2.0, loss=0.02),
    "600 ms and 1 %": Link(delay=0.3, jitter=0.02, loss=0.01),
    "cuts": Link(delay=0.05, loss=0.02, cuts=[(3.0, 6.0), (9.0, 19.0)]),
    "everything": Link(delay=0.1, jitter=0.2, loss=0.2, duplication=0.1, burst=0.01, cuts=[(5.0, 8.0)]),
}


def copied(link: Link) -> Link:
    return Link(link.delay, link.jitter, link.loss, link.duplication, link.burst, list(link.cuts))


def speak(world: World[Association], end: Association, seconds: float) -> dict[int, list[bytes]]:
    """Messages of every kind for a while; what was sent, by stream."""
    sent: dict[int, list[bytes]] = {stream: [] for stream in range(5)}
    number = 0
    while world.now < seconds:
        now = world.now
        payload = number.to_bytes(4, "big") + bytes(number * 7 % 300)
        end.send(NEWEST, 51, payload, now, ordered=False, max_retransmits=0)
        sent[NEWEST].append(payload)
        if number % 5 == 0:
            end.send(ORDERED, 51, payload, now)
            sent[ORDERED].append(payload)
            end.send(UNORDERED, 51, payload, now, ordered=False)
            sent[UNORDERED].append(payload)
            end.send(TIMED, 51, payload, now, lifetime=0.2)
            sent[TIMED].append(payload)
        if number % 60 == 0:
            large = number.to_bytes(4, "big") + bytes(9000)
            end.send(BULK, 51, large, now)
            sent[BULK].append(large)
        number += 1
        world.run(now + 0.02)
    return sent


def received(end: Association) -> dict[int, list[bytes]]:
    got: dict[int, list[bytes]] = {stream: [] for stream in range(5)}
    for event in end.events():
        assert not isinstance(event, Closed), event
        if isinstance(event, MessageReceived):
            got[event.stream].append(event.payload)
    return got


def assert_delivered(sent: dict[int, list[bytes]], got: dict[int, list[bytes]]) -> None:
    assert got[ORDERED] == sent[ORDERED]
    assert got[BULK] == sent[BULK]
    assert sorted(got[UNORDERED]) == sorted(sent[UNORDERED])
    for stream in (NEWEST, TIMED):
        assert len(set(got[stream])) == len(got[stream])
        assert set(got[stream]) <= set(sent[stream])
    assert all(first < second for first, second in pairwise(got[TIMED]))


@pytest.mark.parametrize("interleaving", [False, True])
@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("seed", [1, 2])
def test_reliable_messages_arrive_once_and_in_order(name: str, interleaving: bool, seed: int) -> None:
    link = NETWORKS[name]
    settings = SctpSettings(interleaving=interleaving)
    world, first, second = associated(settings, copied(link), copied(link), seed=seed, seconds=0.0)
    sent = speak(world, first, 20.0)
    world.run(world.now + 200.0, stop=lambda: Internals(first).is_idle)
    assert_delivered(sent, received(second))
    assert first.state is second.state is State.ESTABLISHED
    assert Internals(first).is_idle
    assert Internals(second).held == 0


def test_most_newest_wins_messages_arrive_under_loss_in_one_way_time() -> None:
    world, first, second = associated(there=Link(delay=0.15, loss=0.1), back=Link(delay=0.15, loss=0.1))
    sent = speak(world, first, 20.0)
    world.run(world.now + 0.151)
    arrived = len(received(second)[NEWEST])
    assert arrived > 0.85 * len(sent[NEWEST])


def test_an_hour_long_cut_ends_nothing_and_keeps_a_bounded_amount() -> None:
    cut = [(2.0, 3602.0)]
    world, first, second = associated(there=Link(cuts=cut), back=Link(cuts=cut))
    world.run(2.0)
    first.send(ORDERED, 51, b"before", world.now)
    most = 0
    for _ in range(36_000):
        first.send(NEWEST, 51, bytes(300), world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.1)
        most = max(most, Internals(first).outstanding)
    assert most <= first.settings.max_outstanding
    second.events()
    world.run(3610.0)
    first.send(ORDERED, 51, b"after", world.now)
    world.run(3612.0)
    arrived = [event.payload for event in second.events() if isinstance(event, MessageReceived)]
    assert [payload for payload in arrived if payload in (b"before", b"after")] == [b"before", b"after"]
    assert Internals(first).is_idle


@pytest.mark.parametrize("seed", range(20))
def test_both_ends_find_each_other_when_most_of_the_handshake_is_lost(seed: int) -> None:
    first, second = Association(SctpSettings(), seeded(seed)), Association(SctpSettings(), seeded(seed + 100))
    world = World(first, second, Link(loss=0.6), Link(loss=0.6), seed)
    first.start(0.0)
    first.send(0, 51, b"early", 0.0)
    second.start(0.1)
    world.run(120.0, stop=lambda: first.state is second.state is State.ESTABLISHED)
    world.links = (Link(), Link())
    world.run(world.now + 10.0)
    assert first.state is second.state is State.ESTABLISHED
    assert MessageReceived(0, 51, b"early") in second.events()
