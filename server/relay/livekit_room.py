"""A room of LiveKit as a publisher, by its client for Python (the wheel `livekit`). Lives in a process of its own."""

import asyncio
import struct
import time
from collections import deque
from collections.abc import Callable

from livekit import rtc

from server.relay.livekit_wire import (
    Ended,
    Feedback,
    Join,
    Joined,
    Order,
    Picture,
    Room,
    Said,
    Sound,
    Track,
    WantsKeyframe,
)

__all__ = ["LiveKitRoom"]

CONNECT_SECONDS = 5.0
POLL_SECONDS = 0.05  # between two looks at what an encoder would be told
ROOM_SECONDS = 1.0  # between two words about the path
RECONNECT_SECONDS = 3.0  # that the client may try by itself; then the console does, with a new room
MOST_SOUNDS = 10  # packets that wait
MOST_MESSAGE = 1200  # bytes: one datagram
SOUND_HEAD = struct.Struct("!BIH")  # the track's number, RTP timestamp, bytes that follow
ADRIFT = 0.5  # s between a picture's time and its arrival; more is another clock
CODECS = {"H264": rtc.VideoCodec.H264, "VP8": rtc.VideoCodec.VP8}
REFUSALS = ("401", "403", "unauthorized", "invalid token", "permission")


class LiveKitRoom:
    """`run`, then `leave`. `take` and `end` at any time, on the loop."""

    def __init__(self, say: Callable[[Said], None]) -> None:
        self._say = say
        self._room = rtc.Room()
        self._sources: dict[int, CameraSource] = {}
        self._feedback: str | None = None  # the newest
        self._sounds: deque[bytes] = deque(maxlen=MOST_SOUNDS)
        self._filled = asyncio.Event()
        self._over: asyncio.Future[Ended | None] = asyncio.get_running_loop().create_future()
        self._giving_up: asyncio.TimerHandle | None = None

    async def run(self, join: Join) -> Ended | None:
        """Publish until it ends; why, or None when it was told to."""
        self._room.on("disconnected", lambda reason: self._end(Ended("lost", f"disconnected ({reason})")))
        self._room.on("reconnecting", self._reconnecting)
        self._room.on("reconnected", self._reconnected)
        try:
            options = rtc.RoomOptions(auto_subscribe=False, connect_timeout=CONNECT_SECONDS)
            await self._room.connect(join.url, join.token, options)
        except rtc.ConnectError as error:
            return _refusal(error.message, join.token)
        try:
            for index, track in enumerate(join.tracks):
                if track.kind == "video":
                    self._sources[index] = await self._publish(track)
        except rtc.participant.PublishTrackError as error:
            return Ended("refused", f"a track was not published: {error.message}"[:200])
        self._say(Joined())
        tasks = [asyncio.create_task(self._send()), asyncio.create_task(self._ask())]
        try:
            return await self._over
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def leave(self) -> None:
        await self._room.disconnect()

    def take(self, order: Order) -> None:
        if isinstance(order, Picture):
            if (source := self._sources.get(order.track)) is not None:
                source.capture(order)
        elif isinstance(order, Sound):
            self._sounds.append(SOUND_HEAD.pack(order.track & 0xFF, order.time, len(order.data)) + order.data)
            self._filled.set()
        elif isinstance(order, Feedback):
            self._feedback = order.text
            self._filled.set()

    def end(self) -> None:
        """The console wants no more of it."""
        self._end(None)

    def _end(self, why: Ended | None) -> None:
        if not self._over.done():
            self._over.set_result(why)

    def _reconnecting(self) -> None:
        if self._giving_up is None:
            why = Ended("lost", "the connection was lost")
            self._giving_up = asyncio.get_running_loop().call_later(RECONNECT_SECONDS, self._end, why)

    def _reconnected(self) -> None:
        if self._giving_up is not None:
            self._giving_up.cancel()
            self._giving_up = None

    async def _publish(self, track: Track) -> "CameraSource":
        source = rtc.EncodedVideoSource(track.width, track.height)
        options = rtc.TrackPublishOptions(
            source=rtc.TrackSource.SOURCE_CAMERA,
            simulcast=False,
            video_codec=CODECS[track.codec],
            video_encoder=rtc.VideoEncoderBackend.ENCODER_BACKEND_PRE_ENCODED,
            video_encoding=rtc.VideoEncoding(max_bitrate=track.bitrate_bps, max_framerate=track.frame_rate),
            stream=track.name,
        )
        local = rtc.LocalVideoTrack.create_video_track(track.name, source)
        await self._room.local_participant.publish_track(local, options)
        return CameraSource(track, source)

    async def _send(self) -> None:
        """Feedback and sound, one message at a time."""
        while True:
            await self._filled.wait()
            self._filled.clear()
            if self._feedback is not None:
                text, self._feedback = self._feedback, None
                await self._publish_data(text.encode(), "feedback")
            if self._sounds:
                await self._publish_data(self._waiting_sounds(), "sound")
                if self._sounds:
                    self._filled.set()

    def _waiting_sounds(self) -> bytes:
        """What waits goes together, as far as one message holds it: each takes a while to be taken."""
        found = self._sounds.popleft()
        while self._sounds and len(found) + len(self._sounds[0]) <= MOST_MESSAGE:
            found += self._sounds.popleft()
        return found

    async def _publish_data(self, data: bytes, topic: str) -> None:
        try:
            async with asyncio.timeout(RECONNECT_SECONDS):
                await self._room.local_participant.publish_data(data, reliable=False, topic=topic)
        except (rtc.participant.PublishDataError, TimeoutError):
            pass  # it is lost like one on the way; a connection that is gone ends it elsewhere

    async def _ask(self) -> None:
        """Keyframes that somebody needs, and how much the path takes."""
        told = 0.0
        while True:
            await asyncio.sleep(POLL_SECONDS)
            now = time.monotonic()
            due = now - told >= ROOM_SECONDS
            for index, source in self._sources.items():
                feedback = source.source.take_feedback()
                if feedback.keyframe_requested:
                    self._say(WantsKeyframe(index))
                if feedback.rate_control is not None:
                    source.room_bps = feedback.rate_control.target_bitrate_bps
                if due and source.room_bps:
                    self._say(Room(index, source.room_bps))
            if due:
                told = now


class CameraSource:
    """One camera's way into the client."""

    def __init__(self, track: Track, source: rtc.EncodedVideoSource) -> None:
        self.source = source
        self.room_bps = 0  # bit/s that the path takes; 0 before the first word
        self._track = track
        self._codec = CODECS[track.codec]
        self._offset: float | None = None  # from pictures' times to this machine's monotonic clock, s
        self._last_us = 0

    def capture(self, picture: Picture) -> None:
        kind = rtc.EncodedFrameType.ENCODED_FRAME_KEY if picture.keyframe else rtc.EncodedFrameType.ENCODED_FRAME_DELTA
        self.source.capture_frame(
            rtc.EncodedVideoFrame(
                data=picture.data,
                width=self._track.width,
                height=self._track.height,
                codec=self._codec,
                frame_type=kind,
                timestamp_us=self._timestamp_us(picture.time, time.monotonic()),
            )
        )

    def _timestamp_us(self, taken: float, now: float) -> int:
        """When it was taken, on this machine's monotonic clock; later than the one before."""
        if self._offset is None or abs(taken + self._offset - now) > ADRIFT:
            self._offset = now - taken
        self._offset = min(self._offset, now - taken)  # never in the future
        self._last_us = max(self._last_us + 1, int((taken + self._offset) * 1e6))
        return self._last_us


def _refusal(message: str, token: str) -> Ended:
    words = message.replace(token, "…")[:200]
    refused = any(each in words.lower() for each in REFUSALS)
    return Ended("refused" if refused else "unreachable", words or "no connection")
