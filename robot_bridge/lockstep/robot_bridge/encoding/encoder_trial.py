"""Tries the encoder of the settings when the bridge starts, before a picture needs it."""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.encoding_requests import EncodingGoal
from lockstep.robot_bridge.encoding.picture_encoder import MOST_WRONG, H264Encoder
from lockstep.robot_bridge.errors import EncodingFailed

__all__ = ["try_encoder", "try_in_time"]

SECONDS = 10.0  # a driver that loads its libraries takes some; one that hangs takes for ever
TRIED_SIZE, TRIED_BITRATE = (640, 480), 500_000
TRIED_RATE = 30.0  # Hz


async def try_in_time(name: str, seconds: float = SECONDS, trial: Callable[[str], str] | None = None) -> str:
    """Try an encoder, for at most `seconds`; return why it cannot be used, or "".

    `trial`: runs in a thread; None: `try_encoder`. A trial that hangs in a driver cannot be ended: its thread is a
    daemon, so that the bridge can end all the same.
    """
    loop = asyncio.get_running_loop()
    tried: asyncio.Future[str] = loop.create_future()

    def settle(why: str) -> None:
        if not tried.done():
            tried.set_result(why)

    def work() -> None:
        try:
            why = (trial or try_encoder)(name)
        except Exception as error:  # an unexpected error of the library: pictures must come all the same
            why = f"{name} cannot be used: {error!r}"
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(settle, why)

    threading.Thread(target=work, name="encoder-trial", daemon=True).start()
    try:
        async with asyncio.timeout(seconds):
            return await tried
    except TimeoutError:
        return f"{name} cannot be used: it gave no picture within {seconds:g} s"


def try_encoder(name: str) -> str:
    """Encode grey pictures with an encoder; return why it cannot be used, or "". May take seconds, or hang."""
    reasons: list[str] = []
    encoder = H264Encoder(name, fell_back=reasons.append)
    width, height = TRIED_SIZE
    payload = bytes([128]) * (width * height * 3 // 2)
    for number in range(MOST_WRONG):
        media = Media(
            stream="", codec="yuv420p", stamp=1, time=number / TRIED_RATE, payload=payload, width=width, height=height
        )
        with suppress(EncodingFailed):
            encoder.encode(media, EncodingGoal(TRIED_BITRATE, 0.0, 1.0), keyframe=number == 0)
    return reasons[0] if reasons else ""
