"""Counts what a report says of a session: by driver, by camera, and the moments at which something was wrong. No I/O.

Show `Totals` every record in the order of the file.
"""

from dataclasses import dataclass, field

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.format.records import (
    CommandRecord,
    Degraded,
    FeedbackRecord,
    OwnRecord,
    RefusalRecord,
    ReportRecord,
    RobotRecord,
    SeatRecord,
    StopRecord,
)
from lockstep.server.recording.reading.command_delays import CommandDelays
from lockstep.server.recording.reading.samples import Samples

__all__ = ["CameraTotals", "DriverTotals", "Moment", "Totals"]

SECOND = 1_000_000  # µs
SILENCE = SECOND  # without a picture of a camera; of a slow camera three of its intervals
SPACING = SECOND  # between two moments of the same kind
MAX_MOMENTS = 400
MAX_DRIVERS = 50
MAX_CAMERAS = 16


@dataclass
class Moment:
    """Something that was wrong. Times in µs since 1970."""

    event: int
    time: int
    kind: str  # "refusal", "stop", "fault", "link", "lost", "no pictures"
    text: str
    camera: str = ""  # that it is about; "": all


@dataclass
class DriverTotals:
    name: str
    role: str = ""
    seconds: float = 0.0  # with the seat
    commands: int = 0  # that reached the robot
    events: int = 0  # executed
    refusals: dict[str, int] = field(default_factory=dict)  # by reason
    take_overs: int = 0  # the seat was taken from whoever had it
    answered: Samples = field(default_factory=Samples)  # ms from a command to its feedback, at the console
    pictures: Samples = field(default_factory=Samples)  # ms from a command to its picture, by the page's own clock


@dataclass
class CameraTotals:
    name: str
    promised: float = 0.0  # Hz; 0: the robot's description does not say
    count: int = 0
    keyframes: int = 0
    intervals: Samples = field(default_factory=Samples)  # s between two captures
    behind: Samples = field(default_factory=Samples)  # events that its stamp is behind the feedback, at arrival
    silences: int = 0
    longest: float = 0.0  # s without a picture
    shown_gap: int = 0  # largest that the operator's page reports to have shown, events
    last: int = 0  # µs, arrival of the newest
    captured: int = 0


class Totals:
    """Attributes:
    epochs, lost, stops: numbers; of records that were left out, and of stops
    moments: the first ones
    """

    def __init__(self, description: RobotDescription | None = None) -> None:
        self.drivers: dict[str, DriverTotals] = {}
        self.cameras: dict[str, CameraTotals] = {}
        self.moments: list[Moment] = []
        self.events = self.commands = self.lost = self.stops = self.handovers = 0
        self.intervals = Samples()  # s between two events of the robot's own clock
        self._rates = {each.name: each.frame_rate for each in description.cameras} if description else {}
        self._holder = ""
        self._since = 0
        self._event = 0
        self._time = 0.0
        self._delays = CommandDelays()
        self._stopped = False
        self._faults: set[str] = set()
        self._link = ""
        self._said: dict[tuple[str, str], int] = {}

    def picture(self, camera: str, stamp: int, arrived: int, captured: int, *, keyframe: bool) -> None:
        """Take a picture. Times in µs."""
        if camera not in self.cameras and len(self.cameras) >= MAX_CAMERAS:
            return
        known = self.cameras.setdefault(camera, CameraTotals(camera, self._rates.get(camera, 0.0)))
        if known.count:
            pause = (captured - known.captured) / SECOND
            known.intervals.add(pause)
            known.longest = max(known.longest, pause)
            if pause * SECOND > max(SILENCE, 3 * SECOND / known.promised if known.promised else 0):
                known.silences += 1
                self._moment(stamp, arrived, "no pictures", f"none of {camera} for {pause:.1f} s", camera)
        known.count += 1
        known.keyframes += keyframe
        known.captured, known.last = captured, arrived
        if self._event:
            known.behind.add(max(0, event_gap(self._event, stamp)))

    def own(self, record: OwnRecord, arrived: int) -> None:
        """Take one of Lockstep's own records, which arrived at `arrived` (µs)."""
        delay = self._delays.take(record, arrived * 1000)
        match record:
            case FeedbackRecord():
                self._feedback(record, arrived, delay)
            case CommandRecord(outcome="forwarded"):
                self.commands += 1
                self._driver(record.name).commands += 1
            case RefusalRecord():
                driver = self._driver(record.name or self._holder)
                driver.refusals[record.reason] = driver.refusals.get(record.reason, 0) + 1
                self._moment(record.event, arrived, "refusal", f"{record.reason} {record.detail}".strip())
            case SeatRecord():
                self._seat(record, arrived)
            case StopRecord(kind="stop"):
                self.stops += 1
            case Degraded():
                self.lost += record.lost
                self._moment(record.event, arrived, "lost", f"the recorder left {record.lost} records out")
            case RobotRecord():
                if record.link == "down" and self._link == "up":
                    self._moment(record.event, arrived, "link", f"robot link lost {record.detail}".strip())
                self._link = record.link
            case ReportRecord():
                self._report(record)

    def next_part(self, description: RobotDescription, *, goes_on: bool) -> None:
        """Take what follows, of another file. `goes_on`: with the events of the file before."""
        self._rates |= {each.name: each.frame_rate for each in description.cameras}
        for name, rate in self._rates.items():
            if name in self.cameras:
                self.cameras[name].promised = rate
        if not goes_on:
            self._event, self._time, self._delays = 0, 0.0, CommandDelays()

    def end(self, at: int) -> None:
        """The session ends at `at`, in µs."""
        self._leave(at)

    def _feedback(self, record: FeedbackRecord, arrived: int, delay: float | None) -> None:
        if record.event != self._event:
            driver = self._driver(self._holder)
            driver.events += 1
            self.events += 1
            if self._event and record.time > self._time:
                self.intervals.add(record.time - self._time)
            if delay is not None:
                driver.answered.add(delay)
            self._event, self._time = record.event, record.time
        if record.stop.stopped and not self._stopped:
            self._moment(record.event, arrived, "stop", f"{record.stop.by}: {record.stop.reason}".strip(": "))
        self._stopped = record.stop.stopped
        for fault in set(record.faults) - self._faults:
            self._moment(record.event, arrived, "fault", fault)
        self._faults = set(record.faults)

    def _seat(self, record: SeatRecord, arrived: int) -> None:
        name = record.name if record.holder else ""
        self._leave(arrived)
        if name and name != self._holder:
            if self._holder or record.why == "taken":
                self._driver(name).take_overs += 1
            self.handovers += 1
        self._holder, self._since = name, arrived
        if name:
            self._driver(name).role = record.role

    def _leave(self, at: int) -> None:
        if self._holder and self._since:
            self._driver(self._holder).seconds += max(0, at - self._since) / SECOND
        self._since = at

    def _report(self, record: ReportRecord) -> None:
        if record.report.picture_delay_ms is not None:
            self._driver(record.name).pictures.add(record.report.picture_delay_ms)
        for stream in record.report.streams:
            known = self.cameras.get(stream.stream)
            if known is not None:
                known.shown_gap = max(known.shown_gap, stream.max_gap)

    def _driver(self, name: str) -> DriverTotals:
        if name not in self.drivers and len(self.drivers) >= MAX_DRIVERS:
            name = "others"
        return self.drivers.setdefault(name, DriverTotals(name))

    def _moment(self, event: int, time: int, kind: str, text: str, camera: str = "") -> None:
        before = self._said.get((kind, camera), 0)
        if time - before < SPACING and before:
            return
        self._said[kind, camera] = time
        if len(self.moments) < MAX_MOMENTS:
            self.moments.append(Moment(event, time, kind, text[:200], camera))
