"""A console without a browser, for scripts, tests and policies."""

from lockstep.client.console import Console
from lockstep.client.control.clutch import Clutch
from lockstep.client.errors import (
    ActionCancelled,
    ActionFailed,
    ActionRefused,
    CommandError,
    CommandRefused,
    ConnectFailed,
    ConsoleError,
    ConsoleLost,
    EditRefused,
    EpisodeRefused,
    GoalNotReached,
    LinkFormatError,
    NoFeedback,
    NoSuchStream,
    NotArmed,
    Refused,
    SeatRefused,
    SignallingRefused,
    StopUnconfirmed,
)
from lockstep.client.media.stream import Picture, Sound
from lockstep.client.policies import Policies
from lockstep.client.recorded_episodes import (
    EpisodePicture,
    RecordedEpisode,
    RecordedEpisodes,
    RecordingInfo,
    RecordingWithEpisodes,
)
from lockstep.client.statistics import ConsoleStatistics, Percentiles, StreamStatistics

__all__ = [
    "ActionCancelled",
    "ActionFailed",
    "ActionRefused",
    "Clutch",
    "CommandError",
    "CommandRefused",
    "ConnectFailed",
    "Console",
    "ConsoleError",
    "ConsoleLost",
    "ConsoleStatistics",
    "EditRefused",
    "EpisodePicture",
    "EpisodeRefused",
    "GoalNotReached",
    "LinkFormatError",
    "NoFeedback",
    "NoSuchStream",
    "NotArmed",
    "Percentiles",
    "Policies",
    "Picture",
    "RecordedEpisode",
    "RecordedEpisodes",
    "RecordingInfo",
    "RecordingWithEpisodes",
    "Refused",
    "SeatRefused",
    "SignallingRefused",
    "Sound",
    "StopUnconfirmed",
    "StreamStatistics",
]
