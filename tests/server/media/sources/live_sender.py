"""A camera for tests: MPEG-TS over UDP with an unsteady network, each picture numbered in its pixels."""

import random
import threading
import time
from collections import deque
from fractions import Fraction
from typing import Any

import av
import numpy as np

from lockstep.robot_bridge.robots.event_strip import draw_event_strip

__all__ = ["LiveSender"]

WIDTH, HEIGHT, RATE = 320, 240, 30
STALL, EVERY = 0.3, 1.5  # s that the network holds everything back, and how often


class LiveSender:
    """Sends while entered. `captured[n]` is when picture n was captured, on the monotonic clock."""

    def __init__(self, url: str, *, profile: str = "high", gop: int = 15, stalls: bool = True) -> None:
        self.captured: dict[int, float] = {}
        self._url = url
        self._profile = profile
        self._gop = gop
        self._stalls = stalls
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live-sender", daemon=True)

    def __enter__(self) -> "LiveSender":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join(10)

    def _run(self) -> None:
        with av.open(self._url, "w", format="mpegts", options={"muxdelay": "0", "flush_packets": "1"}) as container:
            stream = container.add_stream("libx264", rate=RATE)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            stream.codec_context.gop_size, stream.codec_context.max_b_frames = self._gop, 0
            stream.codec_context.time_base = Fraction(1, 90_000)
            stream.options = {
                **{"preset": "ultrafast", "tune": "zerolatency", "profile": self._profile},
                "x264-params": "scenecut=0:8x8dct=1",
            }
            self._send(container, stream)

    def _send(self, container: Any, stream: Any) -> None:
        chance = random.Random(7)
        began = time.monotonic()
        held: deque[Any] = deque()
        free_at, stall_at = began, began + EVERY
        number = 0
        while not self._end.wait(max(0.0, began + number / RATE - time.monotonic())):
            number += 1
            now = time.monotonic()
            self.captured[number] = now
            held.extend(stream.encode(_picture(number, now - began)))
            if self._stalls and now >= stall_at:
                free_at, stall_at = now + STALL * chance.uniform(0.5, 1), now + EVERY
            while held and now >= free_at:
                container.mux(held.popleft())


def _picture(number: int, at: float) -> av.VideoFrame:
    luma = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
    luma[:HEIGHT] = 60
    luma[HEIGHT // 2 :: 7, (5 * number) % WIDTH] = 200
    draw_event_strip(luma[:HEIGHT], number)
    frame = av.VideoFrame.from_ndarray(luma, format="yuv420p")
    frame.pts, frame.time_base = round(at * 90_000), Fraction(1, 90_000)
    return frame
