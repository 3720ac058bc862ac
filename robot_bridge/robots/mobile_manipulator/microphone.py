"""The microphone in the simulation."""

import asyncio
import time
from collections.abc import Callable
from typing import Final

from robot_bridge.metronome import Metronome
from robot_bridge.protocol.description import Microphone
from robot_bridge.protocol.messages import Media
from robot_bridge.robots.base import MediaSource, Stamp
from robot_bridge.robots.mobile_manipulator.hearing import Heard
from robot_bridge.robots.mobile_manipulator.sound import Sound

__all__ = ["SEGMENT_SECONDS", "MicrophoneSource"]

SEGMENT_SECONDS: Final = 0.020
CATCH_UP: Final = 10  # segments made good after the loop was blocked, so that the sound keeps time


class MicrophoneSource(MediaSource):
    """A segment is stamped at its start and made at its end, of what was heard in between.

    Making one takes about 0.2 ms, less than handing it to a thread and back would delay it.
    """

    def __init__(self, microphone: Microphone, take: Callable[[], Heard]) -> None:
        self._microphone = microphone
        self._take = take
        self._sound = Sound(microphone.sample_rate, round(microphone.sample_rate * SEGMENT_SECONDS))

    async def run(self, stamp: Callable[[], Stamp], emit: Callable[[Media], None]) -> None:
        metronome = Metronome(SEGMENT_SECONDS, time.monotonic(), catch_up=CATCH_UP)
        self._take()
        start = stamp()
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            emit(
                Media(
                    stream=self._microphone.name,
                    codec="pcm_s16le",
                    stamp=start.event,
                    time=start.time,
                    payload=self._sound.segment(self._take()),
                    sample_rate=self._microphone.sample_rate,
                    channels=self._microphone.channels,
                )
            )
            start = stamp()
