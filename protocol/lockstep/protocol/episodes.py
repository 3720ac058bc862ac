"""Episodes on the console's `session` channel (docs/episodes.md): requests, their answers, and the state.

An episode is a stretch of a recording, from one event to another, with a task and an outcome.
"""

from typing import Annotated, Literal

import msgspec

__all__ = [
    "EpisodeAnswer",
    "EpisodeCut",
    "EpisodeOutcome",
    "EpisodePhase",
    "EpisodeProblem",
    "EpisodeProblemKind",
    "EpisodeReason",
    "EpisodeRequest",
    "EpisodeState",
    "EpisodeVerb",
    "Task",
]

EpisodeVerb = Literal["start", "keep", "discard", "redo", "mark"]
EpisodeOutcome = Literal["", "success", "failure"]  # "": nobody has said
EpisodePhase = Literal["idle", "resetting", "countdown", "open", "keeping"]
Task = Annotated[str, msgspec.Meta(max_length=300)]
Id = Annotated[str, msgspec.Meta(max_length=64)]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]

EpisodeReason = Literal[
    "",  # granted
    "not_allowed",  # the sender is neither the holder of the seat nor a supervisor
    "too_often",
    "recording_off",  # nothing is recorded, so there is nothing that an episode could be a part of
    "link_down",  # the console has no robot link
    "no_task",  # a task is needed, in words
    "episode_open",  # one is open, or about to be
    "no_episode",  # none is open
    "other_episode",  # the request names another episode than the one that is open
    "empty",  # no event was executed since it began
    "not_written",  # the disk or the recorder failed: it is not kept
]

EpisodeCut = Literal[
    "epoch",  # the robot bridge was restarted
    "link_down",  # the robot link was lost
    "recording_ended",
    "recording_failed",
    "new_part",  # the recording goes on in another file
    "console_ended",
]

EpisodeProblemKind = Literal[
    "camera_missing",  # no picture comes
    "camera_slow",  # fewer than half of the pictures that the camera is described to give
    "camera_behind",  # its newest picture shows an older state than the tolerance allows
    "no_events",  # nobody drives
    "recorder_behind",  # the disk is too slow; records will be left out soon
    "records_lost",  # records were left out
    "disk_low",  # the disk is full soon, and then the recording ends
]


class EpisodeRequest(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="episode_request"):
    """Ask for something to be done; the console answers with `episode_answer` of the same id."""

    id: Id
    do: EpisodeVerb
    episode: Id = ""  # that it is about, so that a late request meets no later one; "": whichever is open
    task: Task = ""  # of `start`, in words; "": as the last one
    outcome: EpisodeOutcome = ""  # of `keep`
    text: Annotated[str, msgspec.Meta(max_length=200)] = ""  # of `mark`


class EpisodeAnswer(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="episode_answer"):
    """The answer to a request, to its sender alone; that of `keep` comes when the episode is on the disk."""

    id: str
    reason: EpisodeReason = ""  # "": granted
    detail: str = ""
    episode: str = ""  # the episode that it was about, or that begins


class EpisodeProblem(msgspec.Struct, frozen=True, kw_only=True):
    """Something that spoils the episode, or will."""

    kind: EpisodeProblemKind
    text: str
    stream: str = ""  # the camera


class EpisodeState(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="episode"):
    """The state of episodes; sent to newcomers, when it changes, and every second while an episode is open."""

    phase: EpisodePhase = "idle"
    episode: str = ""  # id of the one that is open or kept now; "" for none
    number: Count = 0  # counts the takes of a recording, discarded ones too
    task: str = ""  # of this one, or of the last one
    by: str = ""  # who asked for it
    seconds_left: float = 0.0  # of the count-down
    since: float = 0.0  # s since 1970, its begin; 0: none is open
    first_event: Count = 0  # the event that held at its begin; 0: none is open
    kept: Count = 0  # of this recording
    discarded: Count = 0
    cut: Count = 0  # ended by something else than a person; they are in no dataset
    last: str = ""  # what became of the last one, in words
    lost: EpisodeCut | Literal[""] = ""  # why the last one was lost; "": it was not
    last_episode: str = ""  # id of that one; "": it did not begin
    reads_recordings: bool = False  # the console still reads what earlier processes recorded, and cannot say `last` yet
    reset_action: str = ""  # name of the robot's action that is run between episodes; "" for none
    problems: list[EpisodeProblem] = []
