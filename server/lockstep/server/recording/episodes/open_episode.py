"""An episode that is open, and the records that are written of it."""

from typing import Literal, NamedTuple

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.server.recording.format.records import EpisodeRecord

__all__ = ["OpenEpisode", "Place"]

MAX_DRIVERS = 20  # names in the record of an episode


class Place(NamedTuple):
    """The state of the console at one moment."""

    epoch: str
    event: int
    recording: str  # that is written now; "" for none
    link: bool  # the robot link is up
    driver: str  # name of the seat's holder; "" for nobody


class OpenEpisode:
    """An episode from its begin to the record that ends it.

    Attributes:
        last_event: the newest that belongs to it
        is_keeping: its record `kept` is on its way to the disk
        drivers: names of all who drove
        problems: kinds that were seen, with the camera
    """

    def __init__(self, id: str, number: int, task: str, by: str, place: Place) -> None:
        self.id = id
        self.number = number
        self.task = task
        self.by = by
        self.epoch = place.epoch
        self.first_event = place.event
        self.last_event = place.event
        self.is_keeping = False
        self.drivers = [place.driver] if place.driver else []
        self.problems: list[str] = []

    def driven_by(self, name: str) -> None:
        """Note who drives now; "" is nobody."""
        if name and name not in self.drivers and len(self.drivers) < MAX_DRIVERS:
            self.drivers.append(name)

    def spoiled(self, problem: str) -> None:
        """Remember a problem for its record."""
        if problem not in self.problems:
            self.problems.append(problem)

    def record(
        self,
        kind: Literal["start", "kept", "discarded", "cut", "mark"],
        place: Place,
        by: str,
        *,
        outcome: EpisodeOutcome = "",
        why: str = "",
        text: str = "",
    ) -> EpisodeRecord:
        return EpisodeRecord(
            epoch=place.epoch,
            event=place.event,
            episode=self.id,
            number=self.number,
            kind=kind,
            task=self.task,
            outcome=outcome,
            first_event=self.first_event,
            last_event=place.event if kind != "cut" else self.last_event,
            by=by,
            why=why,
            text=text,
            drivers=list(self.drivers),
            problems=list(self.problems),
        )
