"""The media of one connection: a stream for each received section, or mere counters."""

import asyncio
import random
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from lockstep.client.errors import NoSuchStream
from lockstep.client.media.media_gate import GateMode, MediaGate
from lockstep.client.media.receiver_reports import ReceiverReports
from lockstep.client.media.render_log import Rendering
from lockstep.client.media.rtp_counter import RtpCounter
from lockstep.client.media.rtp_header import parse_rtp_header
from lockstep.client.media.stream import Stream
from lockstep.client.statistics import StreamStatistics
from lockstep.client.transport.packets import Packets, PacketSink, stamp_reader
from lockstep.client.transport.sdp import Section
from lockstep.protocol.carriers import Carrier

__all__ = ["MediaReceiver"]

DECODERS = 2  # threads
REPORT_SECONDS = 1.0  # between two receiver reports, on average
CLOCK_RATES = {"video": 90_000, "audio": 48_000}  # Hz; only the unit of the jitter


class MediaReceiver:
    """Receives the media of one connection: `prepare` with the answer's sections, then `run`; `close` at the end."""

    def __init__(
        self,
        tolerance: dict[str, int],
        gate: GateMode,
        on_render: Callable[[str, int], None],
        on_heard: Callable[[str, int], None] | None = None,
    ) -> None:
        self._carrier: Carrier = "native"  # of the source
        self._tolerance = tolerance
        self._gate = gate
        self._on_render = on_render
        self._on_heard = on_heard
        self._streams: list[Stream] = []
        self._counters: dict[int, tuple[Section, RtpCounter]] = {}  # by SSRC
        self._executor: ThreadPoolExecutor | None = None
        self._source: Packets | None = None
        self._reports = ReceiverReports(random.getrandbits(32))

    def prepare(self, source: Packets, sections: list[Section], decode: bool) -> None:
        """Take the packets of `source`, to decode or only to count them."""
        self._source, self._carrier = source, source.carrier
        received = [section for section in sections if section.receives]
        if not decode:
            extension_id = source.extension_id(sections)
            for section in received:
                counter = RtpCounter(extension_id, stamp_reader(self._carrier))
                ssrc = section.ssrcs[0] if section.ssrcs else 0
                self._counters[ssrc] = (section, counter)
                self._reports.add(ssrc, CLOCK_RATES[section.kind])
            source.plain(self._count, lambda data: self._reports.control(data, time.monotonic()))
            return
        sinks: dict[str, PacketSink] = {}
        for section in received:
            sinks[section.mid] = stream = self._new_stream(section)
            self._streams.append(stream)
        source.to_sinks(sinks, sections)
        self._executor = ThreadPoolExecutor(DECODERS, thread_name_prefix="decoder")

    def _new_stream(self, section: Section) -> Stream:
        tolerance = self._tolerance[section.kind]
        return Stream(
            section.stream,
            section.kind,
            section.codecs,
            self._carrier,
            MediaGate(tolerance, self._gate),
            self._on_render,
            on_heard=self._on_heard,
        )

    def _count(self, data: bytes) -> None:
        header = parse_rtp_header(data)
        if header is not None and header.ssrc in self._counters:
            self._counters[header.ssrc][1].take(header)
            self._reports.packet(header, time.monotonic())

    async def run(self) -> None:
        """Decode, or report the streams that are only counted, until cancelled."""
        if self._source is not None and self._counters:
            await self._report(self._source)
        if self._executor is None:
            return
        async with asyncio.TaskGroup() as group:
            for stream in self._streams:
                group.create_task(stream.run(self._executor))

    async def _report(self, source: Packets) -> None:
        """Send receiver reports, spread in time (RFC 3550 6.2): without them the console takes the path for dead."""
        while True:
            await asyncio.sleep(REPORT_SECONDS * random.uniform(0.5, 1.5))
            report = self._reports.report(time.monotonic())
            if report is not None:
                source.send_control(report)

    def round_trip(self, seconds: float) -> None:
        """Take the round trip to the console; lost packets are waited for accordingly."""
        if self._source is not None and self._streams:
            self._source.round_trip(seconds)
        for stream in self._streams:
            stream.round_trip(seconds)

    def feedback(self, event: int) -> None:
        """Take the event of the newest feedback."""
        for stream in self._streams:
            stream.feedback(event)

    def log(self, name: str) -> list[Rendering]:
        """Return the renderings of a stream; none if it is not received."""
        return next((stream.log.all() for stream in self._streams if stream.name == name), [])

    def stream(self, kind: str, name: str) -> Stream:
        """Return the stream `name`, or the first of its kind when `name` is empty.

        Raises:
            NoSuchStream: it is not received.
        """
        streams = [stream for stream in self._streams if stream.kind == kind]
        for stream in streams:
            if name in ("", stream.name):
                return stream
        known = ", ".join(stream.name for stream in streams) or "none"
        raise NoSuchStream(f"no {kind} stream {name!r} is received; received: {known}")

    def reported(self) -> None:
        """Note that the statistics went to the console."""
        for stream in self._streams:
            stream.gate.reported()

    def statistics(self) -> list[StreamStatistics]:
        return [stream.statistics() for stream in self._streams] + [
            self._counted(section, counter) for section, counter in self._counters.values()
        ]

    def _counted(self, section: Section, counter: RtpCounter) -> StreamStatistics:
        return StreamStatistics(
            stream=section.stream,
            kind=section.kind,
            codec=section.codecs.get(counter.payload_type, ""),
            carrier=self._carrier,
            stamp=counter.stamp,
            packets=counter.packets,
            frames=counter.frames,
            lost=counter.lost,
            unstamped=counter.unstamped,
        )

    def end(self) -> None:
        """Note that no more packets will arrive."""
        for stream in self._streams:
            stream.close()

    def close(self) -> None:
        """Wait for the decoders. Idempotent."""
        self.end()
        if self._executor is not None:
            self._executor.shutdown(wait=True)
