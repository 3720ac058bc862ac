"""A kernel with one force-feedback stick, at the level of its calls. It is a fake: it pushes nobody.

It reads the structs by the offsets of a 64-bit machine, as `gcc` gives them for linux/input.h, and not by the code that
is tested.
"""

import ctypes
import errno
import math
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

__all__ = ["FakeKernel", "Felt", "Uploaded"]

UPLOAD, REMOVE, ABILITIES = 0x40304580, 0x40044581, 0x80104535
CONSTANT, SPRING, DAMPER, GAIN, FORCE = 0x52, 0x53, 0x55, 0x60, 0x15


@dataclass
class Uploaded:
    code: int
    direction: float = 0.0  # degrees
    milliseconds: int = 0
    share: float = 0.0
    until: float = 0.0  # s


@dataclass
class Felt:
    right: float = 0.0
    ahead: float = 0.0
    conditions: dict[int, float] = field(default_factory=dict)


@dataclass
class FakeKernel:
    """Implements `SystemCalls`."""

    now: float = 100.0
    room: int = 16
    codes: tuple[int, ...] = (CONSTANT, SPRING, DAMPER, GAIN)
    effects: dict[int, Uploaded] = field(default_factory=dict)
    gain: float = 0.0
    opened: bool = False
    plugged: bool = True
    calls: int = 0
    told: threading.Condition = field(default_factory=threading.Condition)

    def open(self, path: str, flags: int) -> int:
        if not self.plugged:
            raise OSError(errno.ENOENT, path)
        self.opened = True
        return 7

    def close(self, fd: int) -> None:
        self.opened = False
        self.effects.clear()

    def ioctl(self, fd: int, request: int, argument: ctypes.Structure | bytearray | int) -> int:
        self._need(fd)
        if request == ABILITIES:
            assert isinstance(argument, bytearray)
            for code in self.codes:
                argument[code // 8] |= 1 << code % 8
        elif request == REMOVE:
            assert isinstance(argument, int)
            del self.effects[argument]
        elif request == UPLOAD:
            assert isinstance(argument, ctypes.Structure)
            self._upload(argument)
        else:
            raise OSError(errno.ENOTTY, "no such request")
        return 0

    def write(self, fd: int, data: bytes) -> int:
        self._need(fd)
        _seconds, _micros, kind, code, value = struct.unpack("qqHHi", data)
        assert kind == FORCE
        if code == GAIN:
            self.gain = value / 0xFFFF
        else:
            effect = self.effects[code]
            assert effect.milliseconds > 0, "an effect of no length never ends"
            effect.until = self.now + value * effect.milliseconds / 1000
            with self.told:
                self.told.notify_all()
        return len(data)

    def until(self, holds: Callable[[], bool]) -> None:
        """Wait until it holds, after an effect was played or stopped."""
        with self.told:
            assert self.told.wait_for(holds, 20)

    def felt(self, after: float = 0.0) -> Felt:
        """What the hand would feel in `after` seconds, if no call came until then."""
        felt = Felt()
        for effect in self.effects.values():
            if effect.until <= self.now + after:
                continue
            if effect.code == CONSTANT:
                angle = math.radians(effect.direction)  # 0 pushes towards the operator, 90 to the left
                felt.right -= self.gain * effect.share * math.sin(angle)
                felt.ahead -= self.gain * effect.share * math.cos(angle)
            else:
                felt.conditions[effect.code] = self.gain * effect.share
        return felt

    def _upload(self, argument: ctypes.Structure) -> None:
        data = memoryview(argument).cast("B")
        assert len(data) == 48
        code, identifier, direction = struct.unpack_from("HhH", data)
        (button,) = struct.unpack_from("H", data, 6)
        (length,) = struct.unpack_from("H", data, 10)
        assert button == 0
        if identifier == -1:
            if len(self.effects) >= self.room:
                raise OSError(errno.ENOSPC, "no room")
            identifier = len(self.effects)
            struct.pack_into("h", data, 2, identifier)
            self.effects[identifier] = Uploaded(code)
        effect = self.effects[identifier]
        assert effect.code == code
        effect.direction, effect.milliseconds = direction * 360 / 0x10000, length
        if code == CONSTANT:
            effect.share = struct.unpack_from("h", data, 16)[0] / 0x7FFF
        else:
            axes = [struct.unpack_from("HHhh", data, 16 + 12 * axis) for axis in (0, 1)]
            assert axes[0] == axes[1]
            assert axes[0][2] == axes[0][3]
            effect.share = axes[0][2] / 0x7FFF

    def _need(self, fd: int) -> None:
        self.calls += 1
        assert fd == 7
        if not (self.opened and self.plugged):
            raise OSError(errno.ENODEV, "unplugged")
