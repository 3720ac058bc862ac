"""The statistics of a network."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.path import PathStatistics
from lockstep.emulator.impairment.profile import Direction
from lockstep.emulator.transport.client_paths import ClientPaths

__all__ = ["NetworkStatistics", "QueueStatistics", "collect", "count_queue"]


@dataclass
class QueueStatistics:
    """Statistics of all clients' bottlenecks in one direction; times in seconds that packets waited to be sent."""

    now: float = 0.0  # wait now, of the client that waits longest
    mean: float = 0.0
    longest: float = 0.0
    passed: int = 0
    dropped: int = 0


@dataclass
class NetworkStatistics:
    clients: int = 0  # so far
    # By path and direction: {"media": {"to_operator": …}}; paths as in a profile, and "stun".
    paths: dict[str, dict[Direction, PathStatistics]] = field(default_factory=dict)
    queues: dict[Direction, QueueStatistics] = field(default_factory=dict)  # empty without a bottleneck

    def fields(self) -> dict[str, object]:
        """Return the fields for JSON."""
        found = asdict(self)
        for name, directions in self.paths.items():
            for direction, statistics in directions.items():
                found["paths"][name][direction]["mean_delay"] = statistics.mean_delay
        return found

    def count(self, name: str, direction: Direction, statistics: PathStatistics) -> None:
        self.paths.setdefault(name, {}).setdefault(direction, PathStatistics()).add(statistics)


def collect(
    clients: Iterable[ClientPaths],
    signalling: Mapping[Direction, PathStatistics],
    robot: Mapping[tuple[str, Direction], PathStatistics],
    now: float,
) -> NetworkStatistics:
    found = NetworkStatistics()
    for client in clients:
        found.clients += 1
        for (kind, direction), path in client.paths.items():
            found.count(kind, direction, path.statistics)
        for direction, bottleneck in client.bottlenecks.items():
            count_queue(found, direction, bottleneck, now)
    for direction, counts in signalling.items():
        found.count("signalling", direction, counts)
    for (name, direction), statistics in robot.items():
        found.count(name, direction, statistics)
    return found


def count_queue(found: NetworkStatistics, direction: Direction, bottleneck: Bottleneck, now: float) -> None:
    queue = found.queues.setdefault(direction, QueueStatistics())
    total = queue.mean * queue.passed + bottleneck.total_wait
    queue.passed += bottleneck.passed
    queue.dropped += bottleneck.dropped
    queue.mean = total / queue.passed if queue.passed else 0.0
    queue.longest = max(queue.longest, bottleneck.longest_wait)
    queue.now = max(queue.now, bottleneck.wait(now))
