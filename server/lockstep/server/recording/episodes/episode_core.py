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

from lockstep.protocol.episodes import EpisodeCut, EpisodeOutcome, EpisodePhase, EpisodeReason
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.episode_history import CUT_WORDS, EpisodeHistory
from lockstep.server.recording.episodes.next_episode import NextEpisode
from lockstep.server.recording.episodes.open_episode import OpenEpisode, Place
from lockstep.server.recording.format.records import EpisodeRecord

__all__ = ["Effect", "Ended", "EpisodeCore", "EpisodeRefused", "RunReset", "Write"]


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

    end: Literal["kept", "discarded", "cut"]


Effect = Write | RunReset | Ended


class EpisodeCore:
    """All methods return what the caller has to do, in order. Those that a person asks for raise EpisodeRefused.

    Attributes:
        next: what comes before the next episode
        history: what became of those before
        current: the episode that is open or being kept; None: there is none
        task: of the open episode, or of the last one
        by: the person who began it
    """

    def __init__(
        self, draw_id: Callable[[], str], *, countdown: float, resets: bool = False, reset_seconds: float = 30.0
    ) -> None:
        """`resets`: there is a reset action, to be run after each episode."""
        self.history = EpisodeHistory()
        self.next = NextEpisode(self.history, countdown=countdown, resets=resets, reset_seconds=reset_seconds)
        self.current: OpenEpisode | None = None
        self.task = ""
        self.by = ""
        self._draw_id = draw_id

    @property
    def phase(self) -> EpisodePhase:
        """The phase, of the table above."""
        if self.current is None:
            return self.next.phase
        return "keeping" if self.current.is_keeping else "open"

    @property
    def episode(self) -> str:
        """The id of the episode that is open or being kept; "" for none."""
        return "" if self.current is None else self.current.id

    # asked for by people

    def start(self, task: str, by: str, place: Place, now: float) -> list[Effect]:
        if self.current is not None or self.next.wanted is not None:
            raise EpisodeRefused("episode_open", "keep or discard it first")
        _check_place(place)
        task = task or self.task
        if not task:
            raise EpisodeRefused("no_task", "say in words what is to be done")
        self.task = task
        self.next.want(task, by, now)
        return self._begin(place, now)

    def keep(self, episode: str, outcome: EpisodeOutcome, by: str, place: Place) -> list[Effect]:
        current = self._open(episode)
        if event_gap(place.event, current.first_event) <= 0:
            raise EpisodeRefused("empty", "no event was executed since it began")
        current.last_event = place.event
        current.is_keeping = True
        return [Write(current.record("kept", place, by, outcome=outcome))]

    def discard(self, episode: str, by: str, place: Place, now: float) -> list[Effect]:
        """Discard the open episode, or cancel the one that is about to begin."""
        if self.next.wanted is not None:
            if episode:
                raise EpisodeRefused("other_episode")
            self.next.cancel()
            return []
        current = self._open(episode)
        current.last_event = place.event
        self.current = None
        self.history.discard(current.id, current.number)
        return [Write(current.record("discarded", place, by)), Ended("discarded"), *_reset(self.next, now)]

    def redo(self, episode: str, by: str, place: Place, now: float) -> list[Effect]:
        """Discard the open episode, and begin the next one with the same task."""
        task = self._open(episode).task
        _check_place(place)  # else it would be discarded, and no other one begin
        return [*self.discard(episode, by, place, now), *self.start(task, by, place, now)]

    def mark(self, episode: str, text: str, by: str, place: Place) -> list[Effect]:
        current = self._open(episode)
        return [Write(current.record("mark", place, by, text=text or "mark"))]

    # what happens

    def tick(self, place: Place, now: float) -> list[Effect]:
        """Let time pass. Call it a few times a second."""
        if self.next.is_reset_late(now):
            return self.reset_ended("the robot did not end it in time", place, now)
        return self._begin(place, now)

    def reset_ended(self, failure: str, place: Place, now: float) -> list[Effect]:
        """The reset action has ended; `failure`: why it failed, "" if it did not. After a failure nothing begins."""
        if self.phase != "resetting":
            return []
        self.next.end_reset(failure, now)
        return self._begin(place, now)

    def on_disk(self, episode: str, now: float) -> list[Effect]:
        """The record `kept` of that episode is on the disk."""
        current = self.current
        if current is None or not current.is_keeping or current.id != episode:
            return []
        self.current = None
        self.history.keep(current.id, current.number)
        return [Ended("kept"), *_reset(self.next, now)]

    def noted(self, text: str, place: Place) -> list[Effect]:
        """Note a STOP, a reset or a change of the seat in the open episode. None of them ends it."""
        current = self.current
        if current is None or current.is_keeping:
            return []
        current.driven_by(place.driver)
        return [Write(current.record("mark", place, "", text=text))]

    def cut(self, why: EpisodeCut, place: Place) -> list[Effect]:
        """End the open episode, which is in no dataset then. An epoch's end leaves one that is being kept alone."""
        current = self.current
        if current is None:
            self.next.cancel(CUT_WORDS[why], with_reset=why in ("epoch", "link_down"))
            return []
        if current.is_keeping and why not in ("recording_failed", "new_part"):
            return []
        self.current = None
        self.history.cut(current.id, current.number, why)
        if current.is_keeping:
            return [Ended("cut")]
        return [Write(current.record("cut", place._replace(epoch=current.epoch), "", why=why)), Ended("cut")]

    # steps

    def _open(self, episode: str) -> OpenEpisode:
        current = self.current
        if current is None or current.is_keeping:
            raise EpisodeRefused("no_episode", "no episode is open")
        if episode and episode != current.id:
            raise EpisodeRefused("other_episode", "another episode is open by now")
        return current

    def _begin(self, place: Place, now: float) -> list[Effect]:
        """Begin the next episode if its count-down is over."""
        if self.next.counting is None:
            return []
        self.task, self.by = self.next.counting
        if self.next.seconds_left(now):
            return []
        try:
            _check_place(place)
        except EpisodeRefused as refused:
            self.next.cancel(refused.detail)
            return []
        self.next.begun()
        number = self.history.begin(place.recording)
        self.current = OpenEpisode(self._draw_id(), number, self.task, self.by, place)
        return [Write(self.current.record("start", place, self.by))]


def _check_place(place: Place) -> None:
    if not place.link:
        raise EpisodeRefused("link_down", "there is no link to the robot")
    if not place.recording:
        raise EpisodeRefused("recording_off", "start the recording first")


def _reset(following: NextEpisode, now: float) -> list[Effect]:
    """After an episode."""
    return [RunReset()] if following.begin_reset(now) else []
