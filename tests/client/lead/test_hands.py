"""The shells around what holds, on a FIFO in place of the kernel's device."""

import asyncio
import os
from pathlib import Path

import pytest

from lockstep.client.lead.hands import EV_KEY, EV_SYN, EVENT, SYN_DROPPED, PedalHand

PRESSED, RELEASED = 1, 0


async def test_events_that_the_kernel_dropped_release_a_pedal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A release may be among them."""
    monkeypatch.setattr("fcntl.ioctl", lambda *_: 0)
    path = tmp_path / "event0"
    os.mkfifo(path)
    hand = PedalHand(str(path))
    with hand.reading(), path.open("wb", buffering=0) as device:

        async def held_after(kind: int, code: int, value: int, want: bool) -> None:
            device.write(EVENT.pack(0, 0, kind, code, value))
            async with asyncio.timeout(10):
                while hand.held(0.0) is not want:  # noqa: ASYNC110
                    await asyncio.sleep(0.001)

        await held_after(EV_KEY, 30, PRESSED, True)
        await held_after(EV_SYN, SYN_DROPPED, 0, False)
        await held_after(EV_KEY, 30, RELEASED, False)
        await held_after(EV_KEY, 30, PRESSED, True)
