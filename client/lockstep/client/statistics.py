"""A client's figures, under the names that the page's `window.lockstep.stats()` uses. No I/O."""

from collections import deque
from collections.abc import Iterable

import msgspec

from lockstep.client.control.command_gate import GateState
from lockstep.client.media.media_gate import GateMode
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.console import StreamReport
from lockstep.protocol.serial import event_gap

__all__ = ["ConsoleStatistics", "EventRate", "Percentiles", "PictureDelay", "StreamStatistics", "percentiles"]

RATE_WINDOW = 5.0  # s
FORGOTTEN = 3.0  # s after which a picture says nothing about the present delay


class Percentiles(msgspec.Struct, frozen=True, kw_only=True):
    """Percentiles of the last samples; None without samples."""

    count: int = 0  # samples
    median: float | None = None  # half of the samples are at most so large
    p95: float | None = None  # 95 % of them are
    p99: float | None = None  # 99 % of them are
    maximum: float | None = None  # the largest


class StreamStatistics(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of one stream since the connection began."""

    stream: str  # name of the camera or microphone
    kind: str  # "video" or "audio"
    codec: str  # "VP8", "H264", "opus" or "PCMU"; "" before the first packet
    carrier: Carrier  # the way in which the stamp travels
    stamp: int = 0  # last one seen; 0 before the first
    gap: int = 0  # at the last rendering
    max_gap: int = 0  # largest |gap| rendered
    mean_gap: float | None = None  # of |gap| rendered; None before the first
    tolerance: int = 0  # largest gap that is rendered
    lag: int = 0  # largest gap seen since the last report, rendered or not
    received: int = 0  # decoded and put to the gate
    rendered: int = 0  # handed on
    discarded: int = 0  # too old, or a newer one came while it was held
    held: int = 0  # ahead of the feedback by more than the tolerance, so that it had to wait
    violations: int = 0  # rendered with |gap| > tolerance: 0 unless the gate is off
    gate: GateMode = "event"  # the rule by which media are rendered
    packets: int = 0  # of RTP
    frames: int = 0  # complete encoded frames
    lost: int = 0  # packets that never came
    unstamped: int = 0  # frames without a stamp
    dropped: int = 0  # frames that no reader took in time, and encoded ones that the decoder was too slow for

    def report(self) -> StreamReport:
        """Return the figures that go to the console."""
        return StreamReport(
            stream=self.stream,
            carrier=self.carrier,
            stamp=self.stamp,
            gap=self.gap,
            max_gap=self.max_gap,
            rendered=self.rendered,
            discarded=self.discarded,
            held=self.held,
            tolerance=self.tolerance,
            lag=self.lag,
            violations=self.violations,
            gate=self.gate,
        )


class ConsoleStatistics(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of `Console.stats()`. Times in ms. `msgspec.to_builtins` makes a dict of them."""

    peer: str = ""  # this connection's id
    epoch: str = ""  # run of the robot bridge
    event: int = 0  # newest feedback; 0 before the first
    armed: bool = False  # whether neutral values are sent while `drive` is not called
    gate: GateState = "no_feedback"  # as `Console.gate_state`
    streams: list[StreamStatistics] = []  # cameras and microphones that are received
    picture_delay_ms: float | None = None  # from a command to the first picture of its event, the last one seen
    picture_delay_p50_ms: float | None = None  # of the same, the median
    picture_delay_p95_ms: float | None = None  # of the same, the 95th percentile
    command_to_picture_ms: Percentiles = Percentiles()  # of the same
    round_trip_ms: float | None = None  # of the last ping
    command_to_feedback_ms: Percentiles = Percentiles()  # from sending a command to the feedback that answers it
    event_rate: float = 0.0  # Hz, over the last 5 s
    bad_messages: int = 0  # messages from the console that could not be read
    repeats: int = 0  # commands sent again because no answer arrived
    echoes: int = 0  # copies of commands because the path loses packets


def percentiles(samples: Iterable[float], scale: float = 1.0) -> Percentiles:
    """Return the nearest-rank percentiles of `samples`, each multiplied by `scale`."""
    ordered = sorted(samples)
    if not ordered:
        return Percentiles()

    def rank(percent: int) -> float:
        return ordered[max(0, -(-len(ordered) * percent // 100) - 1)] * scale

    return Percentiles(count=len(ordered), median=rank(50), p95=rank(95), p99=rank(99), maximum=ordered[-1] * scale)


class EventRate:
    """Measures events per second over the last `RATE_WINDOW`."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque(maxlen=512)

    def event(self, event: int, now: float) -> None:
        """Take the newest event, at every feedback."""
        if not self._seen or self._seen[-1][1] != event:
            self._seen.append((now, event))

    def rate(self, now: float) -> float:
        while self._seen and self._seen[0][0] < now - RATE_WINDOW:
            self._seen.popleft()
        if len(self._seen) < 2:
            return 0.0
        (first_at, first), (last_at, last) = self._seen[0], self._seen[-1]
        return event_gap(last, first) / (last_at - first_at) if last_at > first_at else 0.0


class PictureDelay:
    """Measures command to picture, on the operator's clock alone: from sending command `s` until the first picture
    stamped `s` or newer is shown."""

    def __init__(self) -> None:
        self.samples: deque[float] = deque(maxlen=1024)  # s
        self._waiting: deque[tuple[int, float]] = deque(maxlen=256)
        self._shown_at = float("-inf")

    def sent(self, event: int, now: float) -> None:
        """Note that command `event` left for the first time."""
        self._waiting.append((event, now))

    def shown(self, stamp: int, now: float) -> None:
        """Note that a picture stamped `stamp` is on screen."""
        while self._waiting and event_gap(stamp, self._waiting[0][0]) >= 0:
            _, sent_at = self._waiting.popleft()
            self.samples.append(now - sent_at)
            self._shown_at = now

    def known(self, now: float) -> float | None:
        """Return the present delay in s; None if unknown. The wait for a picture that does not come counts too."""
        if now - self._shown_at > FORGOTTEN:
            return None
        waited = now - self._waiting[0][1] if self._waiting else 0.0
        return max(self.samples[-1], waited)
