"""A publisher for tests: plain aiortc, and pictures that have their number in their pixels."""

import asyncio
import time
from fractions import Fraction
from typing import Any

import av
import httpx
import numpy as np
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription, VideoStreamTrack
from aiortc.rtcrtpsender import RTCRtpSender

from lockstep.robot_bridge.robots.event_strip import draw_event_strip
from lockstep.server.media.published.camera_spec import parse_published
from lockstep.server.media.sources.source_url import SourceSpec

__all__ = ["NumberedPictures", "TestPublisher", "camera"]

WIDTH, HEIGHT, RATE = 320, 240, 20


def camera(text: str = "phone") -> SourceSpec:
    return parse_published([text])[0]


class NumberedPictures(VideoStreamTrack):
    """`captured[n]` is when picture n was captured, on the monotonic clock."""

    def __init__(self) -> None:
        super().__init__()
        self.captured: dict[int, float] = {}
        self.goes_on = asyncio.Event()  # cleared: it stalls
        self.goes_on.set()
        self._began: float | None = None

    async def recv(self) -> Any:
        if self._began is None:
            self._began = time.monotonic()
        number = len(self.captured) + 1
        await asyncio.sleep(max(0.0, self._began + number / RATE - time.monotonic()))
        await self.goes_on.wait()
        now = time.monotonic()
        self.captured[number] = now
        return numbered_picture(number, now - self._began)


def numbered_picture(number: int, at: float) -> av.VideoFrame:
    luma = np.full((HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
    luma[:HEIGHT] = 60
    luma[HEIGHT // 2 :: 7, (5 * number) % WIDTH] = 200
    draw_event_strip(luma[:HEIGHT], number)
    frame = av.VideoFrame.from_ndarray(luma, format="yuv420p")
    frame.pts, frame.time_base = round(at * 90_000), Fraction(1, 90_000)
    return frame


class TestPublisher:
    """Publishes while entered."""

    __test__ = False

    def __init__(self, codec: str = "VP8", *, sound: bool = False) -> None:
        self.pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self.pictures = NumberedPictures()
        self.headers: dict[str, str] = {}
        self.location = ""
        self.tag = ""
        if sound:
            self.pc.addTransceiver("audio", direction="sendonly")
        transceiver = self.pc.addTransceiver(self.pictures, direction="sendonly")
        capabilities = RTCRtpSender.getCapabilities("video").codecs
        transceiver.setCodecPreferences(
            [each for each in capabilities if each.mimeType in (f"video/{codec}", "video/rtx")]
        )

    async def __aenter__(self) -> "TestPublisher":
        return self

    async def __aexit__(self, *_: object) -> None:
        self.pictures.stop()
        await self.pc.close()

    async def offer(self) -> str:
        await self.pc.setLocalDescription(await self.pc.createOffer())
        return self.pc.localDescription.sdp

    async def post(
        self, http: httpx.AsyncClient, headers: dict[str, str], path: str = "/whip", offer: str = ""
    ) -> httpx.Response:
        """Offers, and takes the answer where there is one."""
        content = offer or await self.offer()
        answer = await http.post(path, content=content, headers={**headers, "Content-Type": "application/sdp"})
        if answer.status_code == 201:
            self.headers, self.location, self.tag = headers, answer.headers["location"], answer.headers["etag"]
            await self.take(answer.text)
        return answer

    async def take(self, answer: str) -> None:
        await self.pc.setRemoteDescription(RTCSessionDescription(answer, "answer"))
