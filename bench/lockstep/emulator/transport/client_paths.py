"""All paths between one client and the console. No I/O."""

from collections import OrderedDict
from collections.abc import Hashable

from lockstep.emulator.impairment.bottleneck import Bottleneck
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.packets import Kind
from lockstep.emulator.impairment.path import ImpairedPath, PathStatistics
from lockstep.emulator.impairment.profile import DIRECTIONS, Direction, Profile, TwoWay
from lockstep.emulator.transport.stream_path import StreamPath

__all__ = ["ClientPaths", "SignallingPaths"]

IP_UDP_BYTES = 28  # headers that a bottleneck sends too
KEPT = 1000  # connections


class ClientPaths:
    """The paths of one client: one for each direction and kind of packet, behind one bottleneck each way.

    A STUN check meets the same impairments as control, but with its own random numbers: the number of ICE's checks
    depends on its timers and must not shift the fate of commands.
    """

    def __init__(self, profile: Profile, seed: str, outages: Outages) -> None:
        self.bottlenecks: dict[Direction, Bottleneck] = {}
        self.paths: dict[tuple[Kind, Direction], ImpairedPath] = {}
        self._outages = outages
        kinds: dict[Kind, TwoWay] = {"stun": profile.control, "control": profile.control, "media": profile.media}
        for direction in DIRECTIONS:
            settings = profile.bottleneck(direction)
            if settings is not None:
                self.bottlenecks[direction] = Bottleneck(settings.rate, settings.queue)
            for kind, path in kinds.items():
                self.paths[kind, direction] = ImpairedPath(
                    path.towards(direction), f"{seed} {kind} {direction}", self.bottlenecks.get(direction), outages
                )

    def admit(self, kind: Kind, direction: Direction, now: float, size: int) -> float | None:
        """Return the time at which a datagram arrives, or None. The first one starts the schedule of outages."""
        if not self._outages.started:
            self._outages.start(now)
        return self.paths[kind, direction].admit(now, size + IP_UDP_BYTES)


class SignallingPaths:
    """The paths of HTTP: each connection keeps its own order, and all share a bottleneck each way.

    It is not the bottleneck of media and control: the effect of TCP and those on each other is not emulated.
    """

    def __init__(self, profile: Profile, seed: str, outages: Outages) -> None:
        self.statistics: dict[Direction, PathStatistics] = {each: PathStatistics() for each in DIRECTIONS}
        self._profile = profile
        self._seed = seed
        self._outages = outages
        self._count = 0
        self._connections: OrderedDict[Hashable, dict[Direction, StreamPath]] = OrderedDict()
        self._bottlenecks = {
            direction: Bottleneck(settings.rate)
            for direction in DIRECTIONS
            if (settings := profile.bottleneck(direction)) is not None
        }

    def of(self, connection: Hashable) -> dict[Direction, StreamPath]:
        """Return both directions of a connection; `connection` tells it from others."""
        found = self._connections.get(connection)
        if found is None:
            self._count += 1
            found = self._connections[connection] = {direction: self._path(direction) for direction in DIRECTIONS}
            if len(self._connections) > KEPT:
                self._connections.popitem(last=False)
        return found

    def _path(self, direction: Direction) -> StreamPath:
        back: Direction = "to_robot" if direction == "to_operator" else "to_operator"
        path = StreamPath(
            self._profile.signalling.towards(direction),
            f"{self._seed} signalling {self._count} {direction}",
            back=self._profile.signalling.towards(back).delay.mean,
            bottleneck=self._bottlenecks.get(direction),
            outages=self._outages,
        )
        path.statistics = self.statistics[direction]
        return path
