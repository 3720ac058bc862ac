"""Says of each event of a recording who drove it. No I/O."""

from lockstep.server.recording.format.drivers import NOBODY, EventDriver, EventDrivers
from lockstep.server.recording.format.records import CommandRecord, EpisodeRecord, FeedbackRecord, OwnRecord
from lockstep.server.recording.format.topics import OWN_TOPICS

__all__ = ["DRIVER_TOPICS", "RecordedDrivers"]

DRIVER_TOPICS = frozenset(OWN_TOPICS[kind] for kind in (FeedbackRecord, CommandRecord, EpisodeRecord))
"""The topics whose records `RecordedDrivers.take` needs."""


class RecordedDrivers:
    """Call `take` with the records of these topics in their order; `of` then returns the driver of a feedback.

    Recordings from before feedbacks named their drivers have only people in them: there the command tells.
    """

    def __init__(self) -> None:
        self._drivers = EventDrivers()
        self._newest = NOBODY

    def take(self, record: OwnRecord | None) -> None:
        """Take a record; those of other kinds, and None, say nothing."""
        match record:
            case CommandRecord(outcome="forwarded"):
                kind = "human" if record.kind == "none" else record.kind
                self._drivers.forwarded(record.epoch, record.event, record.name, kind)
            case EpisodeRecord(kind="start"):
                self._drivers.episode(begins=True)
            case EpisodeRecord(kind="kept" | "discarded" | "cut"):
                self._drivers.episode(begins=False)
            case FeedbackRecord():
                self._newest = self._drivers.executed(record.epoch, record.event)

    def of(self, feedback: FeedbackRecord) -> EventDriver:
        """Return the driver of the event of the feedback that was taken last."""
        if feedback.driver_kind != "none":
            return EventDriver(feedback.driver, feedback.driver_kind, feedback.intervention)
        return self._newest
