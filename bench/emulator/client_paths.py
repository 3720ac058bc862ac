"""All paths between one client and the console. No I/O."""

from bench.emulator.bottleneck import Bottleneck
from bench.emulator.outages import Outages
from bench.emulator.packets import Kind
from bench.emulator.path import ImpairedPath
from bench.emulator.profile import DIRECTIONS, Direction, Profile, TwoWay

__all__ = ["ClientPaths"]


class ClientPaths:
    """For each direction and kind of packet a path of its own, behind one bottleneck each way.

    A STUN check meets what control meets, but with random numbers of its own: how many checks ICE makes depends on its
    timers and must not shift the fate of commands.
    """

    def __init__(self, profile: Profile, seed: str, outages: Outages) -> None:
        self.bottlenecks: dict[Direction, Bottleneck] = {}
        self.paths: dict[tuple[Kind, Direction], ImpairedPath] = {}
        for direction in DIRECTIONS:
            settings = profile.bottleneck(direction)
            if settings is not None:
                self.bottlenecks[direction] = Bottleneck(settings.rate, settings.queue)
            kinds: dict[Kind, TwoWay] = {"stun": profile.control, "control": profile.control, "media": profile.media}
            for kind, path in kinds.items():
                self.paths[kind, direction] = ImpairedPath(
                    path.towards(direction), f"{seed} {kind} {direction}", self.bottlenecks.get(direction), outages
                )
