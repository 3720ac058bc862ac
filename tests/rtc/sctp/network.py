"""A seeded network between two cores, on a virtual clock."""

import heapq
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from random import Random
from typing import Generic, Protocol, TypeVar

from lockstep.rtc.sctp import Association, Event, SctpSettings

__all__ = ["Core", "Link", "World", "associated", "drain", "seeded"]


class Core(Protocol):
    """What `Association` and `DataChannels` share."""

    def receive_packet(self, data: bytes, now: float) -> None: ...
    def packets_to_send(self) -> list[bytes]: ...
    def timer(self) -> float | None: ...
    def handle_timer(self, now: float) -> None: ...


@dataclass
class Link:
    """One direction. `lose` is asked for each packet with its number; times are seconds."""

    delay: float = 0.05
    jitter: float = 0.0  # up to so much more, each packet by itself: they overtake each other
    loss: float = 0.0
    duplication: float = 0.0
    burst: float = 0.0  # the chance that a burst of losses begins; it ends with one in four packets
    cuts: list[tuple[float, float]] = field(default_factory=list)  # from, until
    lose: Callable[[int, bytes], bool] = lambda number, packet: False
    sent: int = 0
    in_burst: bool = False

    def arrivals(self, packet: bytes, now: float, random: Random) -> list[float]:
        number, self.sent = self.sent, self.sent + 1
        if any(start <= now < end for start, end in self.cuts) or self.lose(number, packet):
            return []
        self.in_burst = random.random() > 0.25 if self.in_burst else random.random() < self.burst
        if self.in_burst or random.random() < self.loss:
            return []
        copies = 1 + (random.random() < self.duplication)
        return [now + self.delay + random.random() * self.jitter for _ in range(copies)]


T = TypeVar("T", bound=Core)


class World(Generic[T]):
    """Two cores, the links between them, and the time."""

    def __init__(self, first: T, second: T, there: Link | None = None, back: Link | None = None, seed: int = 1) -> None:
        self.ends = (first, second)
        self.links = (there or Link(), back or Link())
        self.random = Random(seed)
        self.now = 0.0
        self.packets: tuple[list[tuple[float, bytes]], ...] = ([], [])  # sent by each
        self._count = itertools.count()
        self._air: list[tuple[float, int, int, bytes]] = []
        self.after_step: Callable[[], None] = lambda: None

    def flush(self) -> None:
        for index in (0, 1):
            for packet in self.ends[index].packets_to_send():
                self.packets[index].append((self.now, packet))
                for at in self.links[index].arrivals(packet, self.now, self.random):
                    heapq.heappush(self._air, (at, next(self._count), 1 - index, packet))

    def next_at(self) -> float | None:
        due = [at for at in (self.ends[0].timer(), self.ends[1].timer()) if at is not None]
        if self._air:
            due.append(self._air[0][0])
        return min(due, default=None)

    def run(self, until: float, stop: Callable[[], bool] = lambda: False) -> None:
        """To the time `until`, or until `stop`."""
        self.flush()
        steps_at_once = 0
        while not stop():
            at = self.next_at()
            if at is None or at > until:
                self.now = max(self.now, until)
                return
            steps_at_once = steps_at_once + 1 if at <= self.now else 0
            assert steps_at_once < 10_000, "time stands still"
            self.now = max(self.now, at)
            while self._air and self._air[0][0] <= self.now:
                _, _, index, packet = heapq.heappop(self._air)
                self.ends[index].receive_packet(packet, self.now)
                self.flush()
            for end in self.ends:
                if (due := end.timer()) is not None and due <= self.now:
                    end.handle_timer(self.now)
            self.flush()
            self.after_step()


def seeded(seed: int) -> Callable[[int], bytes]:
    return Random(seed).randbytes


def associated(
    settings: SctpSettings | None = None,
    there: Link | None = None,
    back: Link | None = None,
    seed: int = 1,
    seconds: float = 1.0,
) -> tuple[World[Association], Association, Association]:
    """Two associations that are up, after `seconds`; their events are drained."""
    settings = settings or SctpSettings()
    first, second = Association(settings, seeded(seed)), Association(settings, seeded(seed + 1000))
    world = World(first, second, there, back, seed)
    first.start(0.0)
    second.start(0.0)
    world.run(seconds)
    drain((first, second))
    return world, first, second


def drain(ends: Iterable[Association]) -> list[list[Event]]:
    return [end.events() for end in ends]
