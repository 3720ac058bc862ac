"""All paths between one client and the console. No I/O."""

from bench.emulator.bottleneck import Bottleneck
from bench.emulator.outages import Outages
from bench.emulator.packets import Kind
from bench.emulator.path import ImpairedPath
from bench.emulator.profile import DIRECTIONS, Direction, Profile, TwoWay
from bench.emulator.stream_path import StreamPath

__all__ = ["ClientPaths", "signalling_paths"]

IP_UDP_BYTES = 28  # headers that a bottleneck sends too


class ClientPaths:
    """For each direction and kind of packet a path of its own, behind one bottleneck each way.

    A STUN check meets what control meets, but with random numbers of its own: how many checks ICE makes depends on its
    timers and must not shift the fate of commands.
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
        """When a datagram arrives; None when it never does. The first one starts the schedule of outages."""
        if not self._outages.started:
            self._outages.start(now)
        return self.paths[kind, direction].admit(now, size + IP_UDP_BYTES)


def signalling_paths(profile: Profile, seed: str, outages: Outages) -> dict[Direction, StreamPath]:
    """HTTP. It has a bottleneck of its own: what TCP and media do to each other at a shared one is not emulated."""
    paths: dict[Direction, StreamPath] = {}
    for direction in DIRECTIONS:
        settings = profile.bottleneck(direction)
        back: Direction = "to_robot" if direction == "to_operator" else "to_operator"
        paths[direction] = StreamPath(
            profile.signalling.towards(direction),
            f"{seed} signalling {direction}",
            back=profile.signalling.towards(back).delay.mean,
            bottleneck=None if settings is None else Bottleneck(settings.rate),
            outages=outages,
        )
    return paths
