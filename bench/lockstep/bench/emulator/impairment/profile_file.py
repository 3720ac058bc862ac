"""The keys of a profile's TOML file. A key that is not here is refused."""

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
    """Milliseconds."""

    shape: Literal["lognormal", "pareto", "uniform", "normal"] = "lognormal"
    min: NotNegative | None = None
    mean: NotNegative | None = None
    max: NotNegative | None = None
    deviation: Positive | None = None


class DirectionTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What one direction does. None: not said here."""

    delay_ms: NotNegative | DelayTable | None = None  # one way
    round_trip_ms: NotNegative | DelayTable | None = None  # instead: half of it each way
    vary_ms: NotNegative | None = None
    loss_percent: Percent | None = None  # one way
    round_trip_loss_percent: Percent | None = None  # instead: as a ping counts
    burst_packets: Annotated[float, msgspec.Meta(ge=1)] | None = None
    good_loss_percent: Percent | None = None
    bad_loss_percent: Percent | None = None
    reorder_percent: Percent | None = None
    reorder_ms: Positive | None = None


class PathTable(DirectionTable, forbid_unknown_fields=True, frozen=True):
    """Both directions, and the differences of one."""

    to_operator: DirectionTable = DirectionTable()
    to_robot: DirectionTable = DirectionTable()


class BottleneckTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    rate_kbps: Positive
    queue_bytes: Bytes | None = None
    queue_ms: Positive | None = None  # instead: the bytes that the rate sends in that time


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
    client: PathTable = PathTable()  # what media, control and signalling have in common
    media: PathTable = PathTable()
    control: PathTable = PathTable()
    signalling: PathTable = PathTable()
    robot: PathTable = PathTable()  # what robot_media and robot_control have in common
    robot_media: PathTable = PathTable()
    robot_control: PathTable = PathTable()
    bottleneck: TwoBottlenecks = TwoBottlenecks()
    outage: list[OutageTable] = []
    experiment: ExperimentTable = ExperimentTable()
