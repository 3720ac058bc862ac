"""The rules of episodes: how they begin, how they end, and their records. No I/O; the caller hands in `now`.

| phase | what holds | ends by |
|---|---|---|
| idle | no episode | start |
| resetting | the robot's reset action runs | its end |
| countdown | an episode is about to begin | its time, discard, a cut |
| open | an episode is recorded | keep, discard, redo, a cut |
| keeping | the record `kept` is on its way to the disk | its arrival there, a cut |

Only the record `kept` makes an episode count. Any other end, such as the end of the process, needs no record.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

from lockstep.protocol.episodes import EpisodeOutcome, EpisodePhase, EpisodeReason
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.open_episode import OpenEpisode, Place
from lockstep.server.recording.format.records import EpisodeRecord

__all__ = ["Effect", "Ended", "EpisodeCore", "EpisodeRefused", "RunReset", "Write"]

CUT_WORDS = {
    "epoch": "the robot bridge was restarted",
    "link_down": "the robot link was lost",
    "recording_ended": "the recording ended",
    "recording_failed": "the recording failed",
    "new_part": "the recording went on in another file",
    "console_ended": "the console ended",
}
EpisodeEnd = Literal["kept", "discarded", "cut"]
CutReason = Literal["epoch", "link_down", "recording_ended", "recording_failed", "new_part", "console_ended"]


class EpisodeRefused(Exception):
    """A request was refused.

    Attributes:
        reason: its name
        detail: more about it, for a person
    """

    def __init__(self, reason: EpisodeReason, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


class Write(NamedTuple):
    """The caller puts this record into the recording."""

    record: EpisodeRecord


class RunReset(NamedTuple):
    """The caller runs the reset action, and calls `reset_ended`."""


class Ended(NamedTuple):
    """The caller says that an episode has ended: one that is kept when its record is on the disk, not before."""

    end: EpisodeEnd


Effect = Write | RunReset | Ended


class EpisodeCore:
    """All methods return what the caller has to do, in order. Those that a person asks for raise EpisodeRefused.

    Attributes:
        phase: of the table above
        task: of the open episode, or of the last one
        last: what became of the last one, in words
    """

    def __init__(
        self, draw_id: Callable[[], str], *, countdown: float, resets: bool = False, reset_seconds: float = 30.0
    ) -> None:
        """`resets`: there is a reset action, to be run after each episode."""
        self.phase: EpisodePhase = "idle"
        self.task = ""
        self.by = ""
        self.last = ""
        self.kept = self.discarded = self.cuts = self.number = 0
        self.resets = resets
        self._draw_id = draw_id
        self._countdown = countdown
        self._reset_seconds = reset_seconds
        self._current: OpenEpisode | None = None  # open, or being kept
        self._recording = ""  # that the counts are of
        self._deadline = 0.0  # of the count-down or the reset
        self._next: tuple[str, str] | None = None  # task and person of the episode that begins after the reset

    @property
    def episode(self) -> str:
        """The id of the episode that is open or being kept; "" for none."""
        return "" if self._current is None else self._current.id

    @property
    def first_event(self) -> int:
        """The event that held when the open episode began; 0: none is open."""
        return 0 if self._current is None else self._current.first_event

    @property
    def is_about_to_begin(self) -> bool:
        """True from the request for an episode to its begin."""
        return self.phase == "countdown" or self._next is not None

    def seconds_left(self, now: float) -> float:
        """Return the rest of the count-down."""
        return max(0.0, self._deadline - now) if self.phase == "countdown" else 0.0

    # asked for by people

    def start(self, task: str, by: str, place: Place, now: float) -> list[Effect]:
        task = task or self.task
        if self.phase in ("open", "keeping") or self.is_about_to_begin:
            raise EpisodeRefused("episode_open", "keep or discard it first")
        self._check_place(place)
        if not task:
            raise EpisodeRefused("no_task", "say in words what is to be done")
        if self.phase == "resetting":
            self.task, self._next = task, (task, by)
            return []
        return self._count_down(task, by, place, now)

    def keep(self, episode: str, outcome: EpisodeOutcome, by: str, place: Place) -> list[Effect]:
        current = self._open(episode)
        if event_gap(place.event, current.first_event) <= 0:
            raise EpisodeRefused("empty", "no event was executed since it began")
        current.last_event = place.event
        self.phase = "keeping"
        return [Write(current.record("kept", place, by, outcome=outcome))]

    def discard(self, episode: str, by: str, place: Place, now: float) -> list[Effect]:
        """Discard the open episode, or cancel the one that is about to begin."""
        if self.is_about_to_begin:
            if episode:
                raise EpisodeRefused("other_episode")
            self._next = None
            if self.phase == "countdown":
                self.phase = "idle"
            self.last = "cancelled before it began"
            return []
        return self._discard(episode, by, place, now)

    def redo(self, episode: str, by: str, place: Place, now: float) -> list[Effect]:
        """Discard the open episode, and begin the next one with the same task."""
        current = self._open(episode)
        self._check_place(place)
        self._next = current.task, by
        return self._discard(episode, by, place, now)

    def mark(self, episode: str, text: str, by: str, place: Place) -> list[Effect]:
        current = self._open(episode)
        return [Write(current.record("mark", place, by, text=text or "mark"))]

    # what happens

    def tick(self, place: Place, now: float) -> list[Effect]:
        """Let time pass. Call it a few times a second."""
        if self.phase == "countdown" and now >= self._deadline:
            return self._begin(place)
        if self.phase == "resetting" and now >= self._deadline:
            return self.reset_ended("the robot did not end it in time", place, now)
        return []

    def reset_ended(self, failure: str, place: Place, now: float) -> list[Effect]:
        """The reset action has ended; `failure`: why it failed, "" if it did not. After a failure nothing begins."""
        if self.phase != "resetting":
            return []
        wanted, self._next, self.phase = self._next, None, "idle"
        if failure:
            self.last += f"; the reset failed: {failure}"
            return []
        if wanted is None:
            return []
        return self._count_down(*wanted, place, now)

    def on_disk(self, episode: str, now: float) -> list[Effect]:
        """The record `kept` of that episode is on the disk."""
        current = self._current
        if current is None or self.phase != "keeping" or current.id != episode:
            return []
        self.kept += 1
        self.last = f"episode {current.number} is kept"
        return [Ended("kept"), *self._end(now)]

    def noted(self, text: str, place: Place) -> list[Effect]:
        """Note a STOP, a reset or a change of the seat in the open episode. None of them ends it."""
        current = self._current
        if current is None or self.phase != "open":
            return []
        current.driven_by(place.driver)
        return [Write(current.record("mark", place, "", text=text))]

    def spoiled(self, problem: str) -> None:
        """Remember a problem of the open episode for its record."""
        if self._current is not None and self.phase == "open" and problem not in self._current.problems:
            self._current.problems.append(problem)

    def cut(self, why: CutReason, place: Place) -> list[Effect]:
        """End the open episode, which is in no dataset then. An epoch's end leaves one that is being kept alone."""
        if self.phase in ("countdown", "resetting"):
            self.cancel(CUT_WORDS[why])
            if why in ("epoch", "link_down"):
                self.phase = "idle"
            return []
        current = self._current
        if current is None or (self.phase == "keeping" and why not in ("recording_failed", "new_part")):
            return []
        place = place._replace(epoch=current.epoch)
        kept, self.phase, self._current = self.phase == "keeping", "idle", None
        self.cuts += 1
        self.last = f"episode {current.number} is lost: {CUT_WORDS[why]}"
        return [Ended("cut")] if kept else [Write(current.record("cut", place, "", why=why)), Ended("cut")]

    def cancel(self, why: str) -> None:
        """Cancel the episode that is about to begin, if there is one. `why`: in words."""
        if not self.is_about_to_begin:
            return
        self._next = None
        if self.phase == "countdown":
            self.phase = "idle"
        self.last = f"cancelled before it began: {why}"

    # steps

    def _check_place(self, place: Place) -> None:
        if not place.link:
            raise EpisodeRefused("link_down", "there is no link to the robot")
        if not place.recording:
            raise EpisodeRefused("recording_off", "start the recording first")

    def _open(self, episode: str) -> OpenEpisode:
        current = self._current
        if current is None or self.phase != "open":
            raise EpisodeRefused("no_episode", "no episode is open")
        if episode and episode != current.id:
            raise EpisodeRefused("other_episode", "another episode is open by now")
        return current

    def _count_down(self, task: str, by: str, place: Place, now: float) -> list[Effect]:
        self.task, self.by = task, by
        self.phase, self._deadline = "countdown", now + self._countdown
        return self.tick(place, now)

    def _begin(self, place: Place) -> list[Effect]:
        try:
            self._check_place(place)
        except EpisodeRefused as refused:
            self.phase, self.last = "idle", f"cancelled before it began: {refused.detail}"
            return []
        if place.recording != self._recording:
            self._recording = place.recording
            self.kept = self.discarded = self.cuts = self.number = 0
        self.number += 1
        current = self._current = OpenEpisode(self._draw_id(), self.number, self.task, self.by, place)
        self.phase = "open"
        return [Write(current.record("start", place, self.by))]

    def _discard(self, episode: str, by: str, place: Place, now: float) -> list[Effect]:
        current = self._open(episode)
        current.last_event = place.event
        self.discarded += 1
        self.last = f"episode {current.number} is discarded"
        return [Write(current.record("discarded", place, by)), Ended("discarded"), *self._end(now, place)]

    def _end(self, now: float, place: Place | None = None) -> list[Effect]:
        """After an episode: the reset, then the next one if it is wanted."""
        self._current = None
        if self.resets:
            self.phase, self._deadline = "resetting", now + self._reset_seconds
            return [RunReset()]
        wanted, self._next, self.phase = self._next, None, "idle"
        return [] if wanted is None or place is None else self._count_down(*wanted, place, now)
