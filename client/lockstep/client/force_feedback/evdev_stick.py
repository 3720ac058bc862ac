"""A joystick behind Linux' event interface, whose driver plays force-feedback effects."""

import ctypes
import fcntl
import os
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from lockstep.client.force_feedback.effect_core import Effect, EffectKind, Order, Play, Stop, Upload
from lockstep.client.force_feedback.errors import ForceFeedbackError
from lockstep.client.force_feedback.ff_effect import (
    EV_FF,
    EVIOCGBIT_FF,
    EVIOCRMFF,
    EVIOCSFF,
    FF_BYTES,
    FF_CODES,
    FF_GAIN,
    InputEvent,
    encode,
)

__all__ = ["EvdevStick", "SystemCalls"]


class SystemCalls(Protocol):
    """The calls to the kernel; each raises OSError."""

    def open(self, path: str, flags: int) -> int: ...

    def ioctl(self, fd: int, request: int, argument: ctypes.Structure | bytearray | int) -> int: ...

    def write(self, fd: int, data: bytes) -> int: ...

    def close(self, fd: int) -> None: ...


class _Linux:
    def open(self, path: str, flags: int) -> int:
        return os.open(path, flags)

    def ioctl(self, fd: int, request: int, argument: ctypes.Structure | bytearray | int) -> int:
        return fcntl.ioctl(fd, request, argument)  # type: ignore[arg-type, unused-ignore]  # a Structure is a buffer

    def write(self, fd: int, data: bytes) -> int:
        return os.write(fd, data)

    def close(self, fd: int) -> None:
        os.close(fd)


class EvdevStick:
    """One open device. When its descriptor is closed, and so when the program dies, the kernel ends its effects.

    Its calls take some milliseconds with a real device; `ForceFeedback` makes them on a thread of its own.
    """

    def __init__(self, path: str | Path, calls: SystemCalls | None = None) -> None:
        """Open a device such as /dev/input/by-id/usb-…-event-joystick.

        Raises:
            ForceFeedbackError: it cannot be opened for writing, or has no constant force.
        """
        self._calls: SystemCalls = _Linux() if calls is None else calls
        self._ids: dict[EffectKind, int] = {}
        self._is_open = False
        try:
            self._fd = self._calls.open(str(path), os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise ForceFeedbackError(f"{path} cannot be opened for reading and writing") from error
        self._is_open = True
        try:
            self.kinds = self._find_kinds()
            if "constant" not in self.kinds:
                raise ForceFeedbackError(f"{path} has no constant force")
            if self._has(FF_GAIN):
                self._event(FF_GAIN, 0xFFFF)
        except OSError as error:
            self.close()
            raise ForceFeedbackError(f"{path} has no force feedback") from error
        except ForceFeedbackError:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def carry_out(self, order: Order) -> None:
        """Upload, play or stop an effect.

        Raises:
            ForceFeedbackError: the device is gone, or has no room for the effect.
        """
        try:
            match order:
                case Upload(effect):
                    self._upload(effect)
                case Play(kind) | Stop(kind) if kind in self._ids:
                    self._event(self._ids[kind], 1 if isinstance(order, Play) else 0)
        except OSError as error:
            raise ForceFeedbackError(f"the stick takes no effect: {os.strerror(error.errno or 0)}") from error

    def close(self) -> None:
        """End all effects and close the device; again does nothing."""
        if not self._is_open:
            return
        self._is_open = False
        try:
            for identifier in self._ids.values():
                self._calls.ioctl(self._fd, EVIOCRMFF, identifier)
        except OSError:
            pass  # it was unplugged; closing erases effects too
        finally:
            self._calls.close(self._fd)

    def _upload(self, effect: Effect) -> None:
        made = encode(effect, self._ids.get(effect.kind, -1))
        self._calls.ioctl(self._fd, EVIOCSFF, made)
        self._ids[effect.kind] = made.id

    def _event(self, code: int, value: int) -> None:
        self._calls.write(self._fd, bytes(InputEvent(type=EV_FF, code=code, value=value)))

    def _find_kinds(self) -> frozenset[EffectKind]:
        self._bits = bytearray(FF_BYTES)
        self._calls.ioctl(self._fd, EVIOCGBIT_FF, self._bits)
        return frozenset(kind for kind, code in FF_CODES.items() if self._has(code))

    def _has(self, code: int) -> bool:
        return bool(self._bits[code // 8] >> code % 8 & 1)
