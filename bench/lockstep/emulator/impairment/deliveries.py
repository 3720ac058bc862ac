"""Delivers packets at their times: a heap of deliveries, and a timer that is finer than an event loop's own.

Event loops round their timers to whole milliseconds; a Linux timer descriptor does not.
"""

import asyncio
import ctypes
import heapq
import os
import sys
import time
from collections.abc import Callable
from itertools import count
from typing import Any

__all__ = ["Deliveries", "prefer_this_process"]

SMALLEST = 1e-6  # s; a timer of 0 would be switched off
TFD_NONBLOCK = os.O_NONBLOCK
TFD_CLOEXEC = os.O_CLOEXEC


def prefer_this_process() -> bool:
    """Let the system run this process before others, if it may: a forwarder that waits for a processor adds delay.

    It needs a few percent of a processor. Processes that it starts are not preferred.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except (OSError, AttributeError):  # root only, Linux only
        return False
    return True


class Deliveries:
    """Calls back at times of `time.monotonic`, in order; of equal times, first in, first out.

    Use inside a running loop; close at the end. After `close` nothing is delivered any more.
    """

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Callable[..., object], tuple[Any, ...]]] = []
        self._numbers = count()
        self._loop = asyncio.get_running_loop()
        self._timer = _Timer(self._loop, self._due)
        self._closed = False

    def __len__(self) -> int:
        return len(self._heap)

    def at(self, when: float, deliver: Callable[..., object], *arguments: Any) -> None:
        """Call `deliver(*arguments)` at `when`; at once if that is now or has passed and nothing else waits."""
        if self._closed:
            return
        if not self._heap and when <= time.monotonic():
            deliver(*arguments)
            return
        heapq.heappush(self._heap, (when, next(self._numbers), deliver, arguments))
        if self._heap[0][0] == when:
            self._timer.arm(when - time.monotonic())

    def close(self) -> None:
        """Drop everything that waits."""
        self._closed = True
        self._heap.clear()
        self._timer.close()

    def _due(self) -> None:
        heap = self._heap
        while heap and heap[0][0] <= time.monotonic():
            _, _, deliver, arguments = heapq.heappop(heap)
            deliver(*arguments)
        if heap and not self._closed:
            self._timer.arm(heap[0][0] - time.monotonic())


class _Timer:
    """A timer descriptor if the system has one, else the loop's own timer."""

    def __init__(self, loop: asyncio.AbstractEventLoop, due: Callable[[], None]) -> None:
        self._loop = loop
        self._due = due
        self._handle: asyncio.TimerHandle | None = None
        self._descriptor = _timer_descriptor()
        if self._descriptor is not None:
            loop.add_reader(self._descriptor, self._fired)

    def arm(self, seconds: float) -> None:
        if self._descriptor is not None:
            _set_timer(self._descriptor, max(seconds, SMALLEST))
            return
        if self._handle is not None:
            self._handle.cancel()
        self._handle = self._loop.call_later(max(seconds, 0), self._due)

    def _fired(self) -> None:
        if self._descriptor is None:
            return
        try:
            os.read(self._descriptor, 8)
        except BlockingIOError:
            return  # armed again since then
        self._due()

    def close(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
        if self._descriptor is not None:
            self._loop.remove_reader(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = None


class _Itimerspec(ctypes.Structure):
    _fields_ = (
        ("interval_s", ctypes.c_long),
        ("interval_ns", ctypes.c_long),
        ("value_s", ctypes.c_long),
        ("value_ns", ctypes.c_long),
    )


_libc = ctypes.CDLL(None, use_errno=True)


def _timer_descriptor() -> int | None:
    if not sys.platform.startswith("linux"):
        return None
    descriptor: int = _libc.timerfd_create(time.CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)
    return descriptor if descriptor >= 0 else None


def _set_timer(descriptor: int, seconds: float) -> None:
    whole = int(seconds)
    spec = _Itimerspec(0, 0, whole, int((seconds - whole) * 1e9))
    if _libc.timerfd_settime(descriptor, 0, ctypes.byref(spec), None) != 0:
        raise OSError(ctypes.get_errno(), "timerfd_settime")
