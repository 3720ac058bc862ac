"""A microphone of a simulated robot: segments of sound, made from the simulation."""

import asyncio
import time
from collections.abc import Callable
from typing import Final

from lockstep.protocol.description import Microphone
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.control.ticks.ticker import Ticker
from lockstep.robot_bridge.robots.base import MediaSource, Stamp

__all__ = ["SEGMENT_SECONDS", "MicrophoneSource"]

SEGMENT_SECONDS: Final = 0.02
CATCH_UP: Final = 10  # segments made good after the loop was blocked, so that the sound keeps time


class MicrophoneSource(MediaSource):
    """Stamps a segment at its start and makes it at its end, as a real microphone would.

    Making one takes about 0.1 ms, less than the delay of handing it to a thread and back.
    """

    def __init__(
        self, microphone: Microphone, segment: Callable[[], bytes], begin: Callable[[], object] | None = None
    ) -> None:
        """`segment`: returns the sound of the last 20 ms as pcm_s16le. `begin`: called when listening begins."""
        self._microphone = microphone
        self._segment = segment
        self._begin = begin

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Ticker(SEGMENT_SECONDS, time.monotonic(), catch_up=CATCH_UP)
        if self._begin is not None:
            self._begin()
        start = stamp()
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            emit(
                Media(
                    stream=self._microphone.name,
                    codec="pcm_s16le",
                    stamp=start.event,
                    time=start.time,
                    payload=self._segment(),
                    sample_rate=self._microphone.sample_rate,
                    channels=self._microphone.channels,
                )
            )
            start = stamp()
