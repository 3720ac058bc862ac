"""The keys of a profile's TOML file. Any other key is refused."""

from typing import Annotated, Literal

import msgspec

__all__ = [
    "BottleneckTable",
    "DelayTable",
    "DirectionTable",
    "ExperimentTable",
    "OutageTable",
    "PathTable",
    "ProfileTable",
    "TwoBottlenecks",
]

Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
Percent = Annotated[float, msgspec.Meta(ge=0, le=100)]
Bytes = Annotated[int, msgspec.Meta(ge=1500)]


class DelayTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A delay distribution, in milliseconds."""

    shape: Literal["lognormal", "pareto", "uniform", "normal"] = "lognormal"
    min: NotNegative | None = None
    mean: NotNegative | None = None
    max: NotNegative | None = None
    deviation: Positive | None = None


class DirectionTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The keys of one direction. None: not given here."""

    delay_ms: NotNegative | DelayTable | None = None  # one way
    round_trip_ms: NotNegative | DelayTable | None = None  # instead of delay_ms: half of it each way
    vary_ms: NotNegative | None = None
    loss_percent: Percent | None = None  # one way
    round_trip_loss_percent: Percent | None = None  # instead of loss_percent: as a ping counts
    burst_packets: Annotated[float, msgspec.Meta(ge=1)] | None = None
    good_loss_percent: Percent | None = None
    bad_loss_percent: Percent | None = None
    reorder_percent: Percent | None = None
    reorder_ms: Positive | None = None


class PathTable(DirectionTable, forbid_unknown_fields=True, frozen=True):
    """The keys of both directions, and the differences of one."""

    to_operator: DirectionTable = DirectionTable()
    to_robot: DirectionTable = DirectionTable()


class BottleneckTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    rate_kbps: Positive
    queue_bytes: Bytes | None = None
    queue_ms: Positive | None = None  # instead of queue_bytes: the bytes that the rate sends in that time


class TwoBottlenecks(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    to_operator: BottleneckTable | None = None
    to_robot: BottleneckTable | None = None


class OutageTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    at_s: NotNegative
    lasts_s: Positive
    every_s: Positive | None = None
    hold: bool = False
    where: Literal["client", "robot"] = "client"


class ExperimentTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Settings of an experiment over this network; None: the experiment's own."""

    video_kbps: Positive | None = None
    frame_rate: Positive | None = None  # Hz
    picture_quality: Annotated[int, msgspec.Meta(ge=1)] | None = None  # of the original's encoder; for the record
    audio_codec: Literal["PCMU", "opus"] | None = None
    audio_playout_max_ms: NotNegative | None = None
    tolerance: Annotated[int, msgspec.Meta(ge=0)] | None = None  # events
    reported_gap: Annotated[int, msgspec.Meta(ge=0)] | None = None  # largest gap that the original reports


class ProfileTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    title: str
    about: str = ""
    client: PathTable = PathTable()  # common to media, control and signalling
    media: PathTable = PathTable()
    control: PathTable = PathTable()
    signalling: PathTable = PathTable()
    robot: PathTable = PathTable()  # common to robot_media and robot_control
    robot_media: PathTable = PathTable()
    robot_control: PathTable = PathTable()
    bottleneck: TwoBottlenecks = TwoBottlenecks()
    robot_bottleneck: TwoBottlenecks = TwoBottlenecks()
    outage: list[OutageTable] = []
    experiment: ExperimentTable = ExperimentTable()
