"""One received stream: packets → frames → decoder → gate → readers."""

import asyncio
import time
from collections.abc import AsyncGenerator, Callable
from concurrent.futures import Executor
from typing import NamedTuple

import av

from lockstep.client.media.decoder import Decoded, Decoder, is_h264_keyframe, is_vp8_keyframe
from lockstep.client.media.frame_assembler import Assembler, AudioAssembler, EncodedFrame, MediaPacket, VideoAssembler
from lockstep.client.media.media_gate import Gated, MediaGate
from lockstep.client.media.newest_queue import NewestQueue, Readers
from lockstep.client.media.render_log import Rendering, RenderLog
from lockstep.client.statistics import StreamStatistics
from lockstep.protocol.carriers import Carrier, split_trailer

__all__ = ["Picture", "Sound", "Stream"]

ENCODED_BOUND = 12  # frames that may wait for the decoder
KEYFRAMES = {"VP8": is_vp8_keyframe, "H264": is_h264_keyframe}


class Picture(NamedTuple):
    """A picture that may be shown now."""

    stream: str  # name of the camera
    stamp: int | None  # event reference at capture; None only with the gate off
    gap: int | None  # newest feedback's event minus the stamp; None only with the gate off
    frame: av.VideoFrame  # `frame.to_ndarray(format="rgb24")` has the shape (height, width, 3), uint8


class Sound(NamedTuple):
    """A segment of sound that may be played now."""

    stream: str  # name of the microphone
    stamp: int | None  # event reference at capture; None only with the gate off
    gap: int | None  # newest feedback's event minus the stamp; None only with the gate off
    frame: av.AudioFrame  # `frame.to_ndarray()` has its samples, `frame.sample_rate` is in Hz


class Stream:
    """One received stream. Pass it packets and feedbacks, run `run`, and read with `read`.

    Attributes:
        readers: get the media that pass the gate; `read` checks them again
    """

    def __init__(
        self,
        name: str,
        kind: str,
        codecs: dict[int, str],
        carrier: Carrier,
        gate: MediaGate[Decoded],
        on_render: Callable[[str, int], None],
        wall_clock: Callable[[], float] = time.time,
        *,
        on_heard: Callable[[str, int], None] | None = None,
    ) -> None:
        """`on_heard` gets the stamps of sound that plays or is too old to, while it is read; `on_render` those of what
        is rendered."""
        self.name = name
        self.kind = kind
        self.carrier = carrier
        self.gate = gate
        self.codec = ""
        self.log = RenderLog()
        self._codecs = codecs
        self._wall_clock = wall_clock
        self._on_render = on_render
        self._on_heard = on_heard
        self._assembler: Assembler | None = None
        self._encoded: NewestQueue[EncodedFrame] = NewestQueue(ENCODED_BOUND)
        self.readers: Readers[Decoded] = Readers()
        self._packets = 0
        self._frames = 0
        self._unstamped = 0
        self._round_trip = 0.0  # s; 0 before one was measured

    # From the network

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        """Take one packet; return True if the sender should be asked for a keyframe."""
        now = asyncio.get_running_loop().time()
        assembler = self._assembler_for(payload_type)
        if assembler is None:
            return False
        self._packets += 1
        for frame in assembler.add(packet, now):
            if not self._assembled(frame, assembler):
                break  # later frames build on it
        return assembler.wants_keyframe(now)

    def round_trip(self, seconds: float) -> None:
        """Take the round trip to the sender."""
        self._round_trip = seconds
        if self._assembler is not None:
            self._assembler.round_trip = seconds

    def _assembler_for(self, payload_type: int) -> Assembler | None:
        codec = self._codecs.get(payload_type, "")
        if codec != self.codec and (codec in KEYFRAMES or self.kind == "audio"):
            self.codec = codec
            self._assembler = AudioAssembler() if self.kind == "audio" else VideoAssembler(KEYFRAMES[codec])
            self._assembler.round_trip = self._round_trip
        return self._assembler

    def _assembled(self, frame: EncodedFrame, assembler: Assembler) -> bool:
        """Queue a frame for the decoder; return False if the decoder is too slow."""
        self._frames += 1
        if self.carrier == "trailer":
            frame = _without_trailer(frame)
        if frame.stamp is None:
            self._unstamped += 1
        if len(self._encoded) >= ENCODED_BOUND:
            self._start_over(assembler)  # the decoder is too slow, and frames build on each other
            return False
        self._encoded.put(frame)
        return True

    def _start_over(self, assembler: Assembler) -> None:
        self._encoded.clear()
        assembler.broken()

    # Through the decoder

    async def run(self, executor: Executor) -> None:
        """Decode until cancelled."""
        loop = asyncio.get_running_loop()
        decoder: Decoder | None = None
        codec = ""
        while True:
            encoded = await self._encoded.get()
            if decoder is None or codec != self.codec:
                codec = self.codec
                decoder = Decoder(codec)
            try:
                frames = await loop.run_in_executor(executor, decoder.decode, encoded)
            except av.FFmpegError:
                if self._assembler is not None:
                    self._start_over(self._assembler)
                continue
            for frame in frames:
                self._offer(frame)

    # Through the gate, to the readers

    def _offer(self, frame: Decoded) -> None:
        self._render(self.gate.offer(frame, frame.stamp))
        if self._on_heard is None or frame.stamp is None or self.kind != "audio" or not self.readers:
            return
        if self.gate.check(frame.stamp)[0] != "hold":
            self._on_heard(self.name, frame.stamp)

    def feedback(self, event: int) -> None:
        """Take the event of the newest feedback."""
        self._render(self.gate.feedback(event))

    def _age(self, medium: Decoded) -> float | None:
        """Return the medium's age in s, if both ends' clocks agree; None if it does not carry its capture time."""
        return None if medium.captured is None else self._wall_clock() - medium.captured

    def _render(self, gated: Gated[Decoded] | None) -> None:
        if gated is None:
            return
        now = asyncio.get_running_loop().time()
        feedback = self.gate.newest_feedback
        self.log.add(Rendering(now, gated.stamp, gated.gap, feedback, self._age(gated.medium)))
        self.readers.put(gated.medium)
        if gated.stamp is not None:
            self._on_render(self.name, gated.stamp)

    async def read(self, bound: int) -> AsyncGenerator[tuple[Decoded, int | None]]:
        """Yield the media that still pass the gate when they are taken, and their gaps.

        `bound`: media that may wait for a slow reader, which loses the oldest.

        Raises:
            QueueClosed: no more media will arrive.
        """
        with self.readers.open(bound) as queue:
            while True:
                medium = await queue.get()
                verdict, gap = self.gate.check(medium.stamp)
                if verdict == "render":
                    yield medium, gap
                else:
                    queue.dropped += 1

    def close(self) -> None:
        """Note that no more media will arrive: readers read the remaining ones, and end."""
        self.readers.close()

    def statistics(self) -> StreamStatistics:
        gate = self.gate
        return StreamStatistics(
            stream=self.name,
            kind=self.kind,
            codec=self.codec,
            carrier=self.carrier,
            stamp=gate.stamp,
            gap=gate.gap,
            max_gap=gate.max_gap,
            mean_gap=gate.mean_gap,
            tolerance=gate.tolerance,
            lag=gate.lag,
            received=gate.received,
            rendered=gate.rendered,
            discarded=gate.discarded,
            held=gate.held,
            violations=gate.violations,
            gate=gate.mode,
            packets=self._packets,
            frames=self._frames,
            lost=self._assembler.lost if self._assembler is not None else 0,
            unstamped=self._unstamped,
            dropped=self._encoded.dropped + self.readers.dropped,
        )


def _without_trailer(frame: EncodedFrame) -> EncodedFrame:
    data, trailer = split_trailer(frame.data)
    if trailer is None:
        return EncodedFrame(frame.timestamp, data, None)
    microseconds = trailer.capture_time_us
    return EncodedFrame(
        frame.timestamp, data, trailer.event, None if microseconds is None else microseconds / 1_000_000
    )
