"""The options of a run, and the settings that follow from its profile. No I/O."""

from dataclasses import dataclass
from typing import Literal

from lockstep.bench.experiment.judge.record import Gate
from lockstep.client.control.command_gate import Pacing
from lockstep.emulator.impairment.profile import Profile

__all__ = ["MODES", "PROFILES", "THESIS_ROBOTS", "Choices", "MediaChoice", "Mode", "media_of", "round_trip_of"]

Mode = Literal["off", "age", "feedback", "media"]
MODES: tuple[Mode, ...] = ("off", "age", "feedback", "media")

# The thesis' networks, each with the robot here of the kind that was driven over it.
THESIS_ROBOTS = {
    "macro-lan": "mobile-manipulator",
    "micro-lan": "micromanipulator",
    "hong-kong": "mobile-manipulator",
}
PROFILES = (*THESIS_ROBOTS, "lte-drive", "wifi-handover", "satellite", "bursty-loss", "narrow-uplink")


# The console's own settings; a profile with a reason has others.
USUAL_KBPS = 800
USUAL_FRAME_RATE = 30.0
USUAL_TOLERANCE = 4
FITTING_KBPS = 300  # pictures that fit through 512 kbit/s together with sound (64 kbit/s) and headers


@dataclass(frozen=True)
class MediaChoice:
    """The settings for pictures and sound. Sound is G.711 µ-law at 8 kHz, mono, unless the profile says otherwise."""

    video_kbps: float
    frames_per_second: float
    sound_codec: str
    tolerance: int  # events
    adapts: bool = False  # the console's quality controller is on

    def environment(self) -> dict[str, str]:
        """Return the choice as the console's settings."""
        return {
            "LOCKSTEP_MEDIA__VIDEO_BITRATE_BPS": str(round(self.video_kbps * 1000)),
            "LOCKSTEP_MEDIA__VIDEO_FRAMES_PER_SECOND": str(self.frames_per_second),
            "LOCKSTEP_MEDIA__SOUND_CODECS": f'["{self.sound_codec}"]',
            "LOCKSTEP_MEDIA__QUALITY": str(self.adapts).lower(),
        }


def media_of(profile: Profile, adapts: bool | None = None) -> MediaChoice:
    """Return the thesis' settings for its profiles, fixed as they were there.

    For other profiles return the console's own settings, its quality controller included, unless `adapts` says
    otherwise.
    """
    said = profile.experiment
    adapting = said.video_kbps is None if adapts is None else adapts
    bottleneck = profile.bottleneck_to_operator
    narrow = bottleneck is not None and bottleneck.rate < 1_000_000 and not adapting
    return MediaChoice(
        said.video_kbps or (FITTING_KBPS if narrow else USUAL_KBPS),
        said.frame_rate or USUAL_FRAME_RATE,
        said.audio_codec or "PCMU",
        USUAL_TOLERANCE if said.tolerance is None else said.tolerance,
        adapting,
    )


def round_trip_of(profile: Profile) -> float:
    """Return the mean time of a command to the robot and its feedback back, in s, without the time in the programs."""
    paths = (profile.control, profile.robot_control)
    return sum(path.to_operator.delay.mean + path.to_robot.delay.mean for path in paths)


@dataclass(frozen=True)
class Choices:
    """The options of one run."""

    profile: str  # a name or a file
    mode: Mode
    seconds: float
    tolerance: int  # events, of pictures and of sound; below 0: the profile's
    seed: int
    robot: str = "planar"
    browser: bool = False
    adapts: bool | None = None  # the quality controller; None: as in `media_of`
    watchers: bool = True  # clients in the other gate modes beside the operator, in the same session

    @property
    def gate(self) -> Gate:
        return self.mode if self.mode == "off" or self.mode == "age" else "event"

    @property
    def pacing(self) -> Pacing:
        return "media" if self.mode == "media" else "feedback"

    @property
    def watching(self) -> tuple[Gate, ...]:
        """The gate modes of the watchers: those that the operator does not have."""
        every: tuple[Gate, ...] = ("off", "age", "event")
        return tuple(mode for mode in every if mode != self.gate) if self.watchers else ()
