"""The robot whose ticks the benchmark of sound listens for."""

import asyncio
import time

import numpy as np

from lockstep.bench.harness.ticking_robot import SAMPLES, TICK_PERIOD, TickingRobot
from lockstep.protocol.description import Microphone
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import Stamp
from lockstep.robot_bridge.robots.microphone_source import MicrophoneSource
from lockstep.robot_bridge.robots.planar.description import MICROPHONE

SEGMENTS = 60  # more than a second


async def test_its_microphone_ticks_at_each_half_second_of_the_monotonic_clock() -> None:
    [source] = [each for each in TickingRobot().sources() if isinstance(each, MicrophoneSource)]
    segments: list[Media] = []
    enough = asyncio.Event()

    def emit(media: Media) -> None:
        segments.append(media)
        if len(segments) == SEGMENTS:
            enough.set()

    async with asyncio.TaskGroup() as group:
        before = time.monotonic()
        listening = group.create_task(source.run(lambda: Stamp(1, time.monotonic()), emit))
        await enough.wait()
        listening.cancel()
    sound = np.concatenate([np.frombuffer(media.payload, "<i2") for media in segments])
    loud = np.flatnonzero(abs(sound) > 1000) / MICROPHONE.sample_rate
    ticks = [at for at in loud if at > 0.01 and at - 0.1 > max((other for other in loud if other < at), default=-1.0)]
    assert len(ticks) >= 2
    assert all(len(media.payload) == SAMPLES * 2 for media in segments)
    # The microphone began no earlier than this; each tick is as far from a half second, but for what passed until then.
    late = [-(before + at) % TICK_PERIOD for at in ticks]
    assert max(late) - min(late) < 0.001


def test_it_is_the_planar_robot_otherwise() -> None:
    description = TickingRobot().describe()
    assert [type(each) for each in description.microphones] == [Microphone]
