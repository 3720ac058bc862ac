"""Reads the terminal or a pedal: the shells around `hold_to_run`."""

import asyncio
import fcntl
import os
import struct
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from lockstep.client.lead.hold_to_run import HeldKey, HeldPedal

__all__ = ["Hand", "KeyHand", "PedalHand"]

KEY = " "
QUIT = ("q", "\x03", "\x04")
EVENT = struct.Struct("llHHi")  # struct input_event (input.h)
EV_SYN, EV_KEY = 0, 1
SYN_DROPPED = 3  # the buffer was full
EVIOCGRAB = 0x40044590  # the pedal's keys are not typed into a terminal as well


class Hand(Protocol):
    """Tells whether the operator holds it."""

    words: str  # what to hold, for people

    @property
    def quit(self) -> asyncio.Event: ...
    def held(self, now: float) -> bool: ...


class KeyHand:
    """The space bar of the terminal."""

    words = "hold the space bar to drive; q ends"

    def __init__(self) -> None:
        self.quit = asyncio.Event()
        self._key = HeldKey()

    def held(self, now: float) -> bool:
        return self._key.held(now) and not self.quit.is_set()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read the terminal, key by key.

        Raises:
            OSError: the standard input is no terminal.
        """
        loop, terminal = asyncio.get_running_loop(), sys.stdin.fileno()
        if not os.isatty(terminal):
            raise OSError("the standard input is no terminal whose space bar could be held: use --pedal")
        before = termios.tcgetattr(terminal)
        tty.setcbreak(terminal)
        loop.add_reader(terminal, self._read, terminal, loop)
        try:
            yield
        finally:
            loop.remove_reader(terminal)
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)

    def _read(self, terminal: int, loop: asyncio.AbstractEventLoop) -> None:
        text = os.read(terminal, 256).decode(errors="replace")
        if not text or any(key in text for key in QUIT):
            self._key.other()
            self.quit.set()
        elif text.strip(KEY):
            self._key.other()
        else:
            self._key.typed(loop.time())


class PedalHand:
    """A pedal or a button that the kernel shows as an input device."""

    words = "hold the pedal to drive; Ctrl-C ends"

    def __init__(self, path: str) -> None:
        self.quit = asyncio.Event()
        self._path = path
        self._pedal = HeldPedal()

    def held(self, now: float) -> bool:
        return self._pedal.held(now) and not self.quit.is_set()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read the device, which nobody else reads meanwhile.

        Raises:
            OSError: it cannot be read.
        """
        loop, device = asyncio.get_running_loop(), os.open(self._path, os.O_RDONLY | os.O_NONBLOCK)
        try:
            fcntl.ioctl(device, EVIOCGRAB, 1)
            loop.add_reader(device, self._read, device)
            yield
        finally:
            loop.remove_reader(device)
            os.close(device)

    def _read(self, device: int) -> None:
        try:
            data = os.read(device, EVENT.size * 64)
        except BlockingIOError:
            return
        except OSError:  # it was unplugged
            self._pedal.gone()
            self.quit.set()
            return
        for _, _, kind, code, value in EVENT.iter_unpack(data):
            if kind == EV_SYN and code == SYN_DROPPED:
                self._pedal.lost()
            elif kind == EV_KEY:
                self._pedal.event(code, value)
