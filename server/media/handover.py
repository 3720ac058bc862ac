"""Streams given to something else than RTP of ours, encoded as they are: one that sends them by its own means."""

import asyncio
from dataclasses import dataclass
from typing import Protocol

from server.media.frame import EncodedFrame
from server.media.packet_stream import SenderStats

__all__ = ["FrameSink", "HandedOverStream", "HandoverSender"]


@dataclass(frozen=True)
class HandedOverStream:
    """What there is to be sent."""

    name: str
    kind: str  # "video", "audio"
    codec: str  # "H264", "VP8", "opus", "PCMU"
    size: tuple[int, int]  # pixels, of the whole picture; (0, 0) for sound
    frame_rate: float  # 1/s, at most; 0 for sound
    bitrate_bps: int  # at most; 0 for sound


class FrameSink(Protocol):
    """What takes the frames of one stream. Called on the loop, returns at once."""

    def __call__(self, frame: EncodedFrame) -> bool:
        """False: it takes nothing now, and the frame is offered again with the next one."""


class HandoverSender:
    """Stands where for other peers RTP is sent. What is behind `sink` has a pacer and reports of its own."""

    paced = False

    def __init__(self, sink: FrameSink) -> None:
        self.stats = SenderStats()
        self._sink = sink

    def flush(self) -> tuple[int, int]:
        return 0, 0

    def transmit(self, frame: EncodedFrame) -> tuple[int, int] | None:
        if not self._sink(frame):
            return None
        self.stats.frames += 1
        self.stats.octets += len(frame.data)
        return 0, len(frame.data)

    def report(self) -> None:
        """Reports are the other side's."""

    async def stop(self) -> None:
        await asyncio.sleep(0)
