"""A network as a value, and the reading of one from a TOML file. docs/networks.md describes the file."""

import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Literal

import msgspec

from lockstep.emulator.errors import ProfileError
from lockstep.emulator.impairment.delay import NO_DELAY, Constant, Delay, Lognormal, Normal, Pareto, Uniform
from lockstep.emulator.impairment.impairment import PERFECT, Impairment, Reordering
from lockstep.emulator.impairment.loss import NO_LOSS, Loss, bursty, independent
from lockstep.emulator.impairment.outages import PlannedOutage
from lockstep.emulator.impairment.profile_file import (
    BottleneckTable,
    DelayTable,
    DirectionTable,
    ExperimentTable,
    OutageTable,
    PathTable,
    ProfileTable,
)

__all__ = [
    "DIRECTIONS",
    "BottleneckSettings",
    "Direction",
    "Profile",
    "TwoWay",
    "even_profile",
    "load_profile",
    "parse_profile",
    "profile_names",
]

Direction = Literal["to_operator", "to_robot"]
DIRECTIONS: tuple[Direction, ...] = ("to_operator", "to_robot")
FOLDER = files("lockstep.emulator") / "profiles"
ENDING = ".toml"
# Keys that say the same thing in two ways: a more particular table's key replaces both of a more general one.
ALTERNATIVES = {
    "delay_ms": "round_trip_ms",
    "round_trip_ms": "delay_ms",
    "loss_percent": "round_trip_loss_percent",
    "round_trip_loss_percent": "loss_percent",
}
DEFAULT_QUEUE = 64_000  # bytes in front of a bottleneck


@dataclass(frozen=True)
class TwoWay:
    """Both directions of one path."""

    to_operator: Impairment = PERFECT
    to_robot: Impairment = PERFECT

    def towards(self, direction: Direction) -> Impairment:
        return self.to_operator if direction == "to_operator" else self.to_robot


@dataclass(frozen=True)
class BottleneckSettings:
    rate: float  # bits a second
    queue: int  # bytes


@dataclass(frozen=True)
class Profile:
    """One network: between each client and the console, and between the console and the robot."""

    name: str
    title: str = ""
    about: str = ""
    media: TwoWay = TwoWay()  # SRTP and SRTCP
    control: TwoWay = TwoWay()  # DTLS: the data channels; STUN too
    signalling: TwoWay = TwoWay()  # HTTP
    robot_media: TwoWay = TwoWay()  # the robot link's media connection
    robot_control: TwoWay = TwoWay()  # the robot link's operator and event connections
    bottleneck_to_operator: BottleneckSettings | None = None  # each client's own, shared by its media and control
    bottleneck_to_robot: BottleneckSettings | None = None
    robot_bottleneck_to_operator: BottleneckSettings | None = None  # shared by the robot link's connections
    robot_bottleneck_to_robot: BottleneckSettings | None = None
    client_outages: tuple[PlannedOutage, ...] = ()
    robot_outages: tuple[PlannedOutage, ...] = ()
    experiment: ExperimentTable = ExperimentTable()

    def bottleneck(self, direction: Direction) -> BottleneckSettings | None:
        return self.bottleneck_to_operator if direction == "to_operator" else self.bottleneck_to_robot

    def robot_bottleneck(self, direction: Direction) -> BottleneckSettings | None:
        if direction == "to_operator":
            return self.robot_bottleneck_to_operator
        return self.robot_bottleneck_to_robot


def even_profile(name: str, impairment: Impairment) -> Profile:
    """Return a profile that is the same each way between a client and the console; the robot link stays perfect."""
    path = TwoWay(impairment, impairment)
    return Profile(name, media=path, control=path, signalling=path)


def profile_names() -> list[str]:
    """Return the names of the profiles that come with Lockstep."""
    return sorted(each.name.removesuffix(ENDING) for each in FOLDER.iterdir() if each.name.endswith(ENDING))


def load_profile(name_or_path: str | Path) -> Profile:
    """Load one of `profile_names`, or a file: anything with a slash or the ending .toml.

    Raises:
        ProfileError: it does not exist, or cannot be used.
    """
    source = str(name_or_path)
    is_file = isinstance(name_or_path, Path) or "/" in source or source.endswith(ENDING)
    if not is_file and source not in profile_names():
        raise ProfileError(source, "", f"there is no such profile; use {', '.join(profile_names())}, or a .toml file")
    found = Path(source) if is_file else FOLDER / (source + ENDING)
    try:
        text = found.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ProfileError(source, "", f"cannot be read ({error}); give the path of a TOML file") from error
    return parse_profile(text, source)


def parse_profile(text: str, source: str) -> Profile:
    """Return the profile in `text`; `source` names it.

    Raises:
        ProfileError: it cannot be used.
    """
    try:
        table = msgspec.convert(tomllib.loads(text), ProfileTable)
    except tomllib.TOMLDecodeError as error:
        raise ProfileError(source, "", f"is not TOML: {error}") from error
    except msgspec.ValidationError as error:
        problem, _, where = str(error).partition(" - at ")
        hint = "docs/networks.md lists the keys"
        raise ProfileError(source, where.strip("`$."), f"{problem}; {hint}") from error
    return _Reader(source).profile(table)


class _Reader:
    def __init__(self, source: str) -> None:
        self._source = source

    def profile(self, table: ProfileTable) -> Profile:
        return Profile(
            name=Path(self._source).name.removesuffix(ENDING),
            title=table.title,
            about=table.about,
            media=self._path("media", table.client, table.media),
            control=self._path("control", table.client, table.control),
            signalling=self._path("signalling", table.client, table.signalling),
            robot_media=self._path("robot_media", table.robot, table.robot_media),
            robot_control=self._path("robot_control", table.robot, table.robot_control),
            bottleneck_to_operator=self._bottleneck("bottleneck.to_operator", table.bottleneck.to_operator),
            bottleneck_to_robot=self._bottleneck("bottleneck.to_robot", table.bottleneck.to_robot),
            robot_bottleneck_to_operator=self._bottleneck(
                "robot_bottleneck.to_operator", table.robot_bottleneck.to_operator
            ),
            robot_bottleneck_to_robot=self._bottleneck("robot_bottleneck.to_robot", table.robot_bottleneck.to_robot),
            client_outages=self._outages(table.outage, "client"),
            robot_outages=self._outages(table.outage, "robot"),
            experiment=table.experiment,
        )

    def _error(self, where: str, problem: str) -> ProfileError:
        return ProfileError(self._source, where, problem)

    def _path(self, name: str, general: PathTable, own: PathTable) -> TwoWay:
        """Return a path from tables, of which later ones replace single keys of earlier ones."""
        return TwoWay(
            *(
                self._impairment(name, _merged(general, getattr(general, direction), own, getattr(own, direction)))
                for direction in DIRECTIONS
            )
        )

    def _impairment(self, where: str, said: dict[str, object]) -> Impairment:
        table = DirectionTable(**said)  # type: ignore[arg-type]
        for one, other in ALTERNATIVES.items():
            if one in said and other in said:
                raise self._error(where, f"has both {one} and {other}; keep one")
        return Impairment(
            delay=self._delay(where, table),
            loss=self._loss(where, table),
            vary=(table.vary_ms or 0.0) / 1000,
            reorder=self._reorder(where, table),
        )

    def _delay(self, where: str, table: DirectionTable) -> Delay:
        key, said, scale = "delay_ms", table.delay_ms, 1 / 1000
        if table.round_trip_ms is not None:
            key, said, scale = "round_trip_ms", table.round_trip_ms, 1 / 2000
        if said is None:
            return NO_DELAY
        if isinstance(said, float | int):
            return Constant(said * scale)
        try:
            return _distribution(said, scale)
        except ValueError as error:
            raise self._error(f"{where}.{key}", str(error)) from error

    def _loss(self, where: str, table: DirectionTable) -> Loss:
        share = (table.loss_percent or 0.0) / 100
        if table.round_trip_loss_percent is not None:
            share = 1 - (1 - table.round_trip_loss_percent / 100) ** 0.5
        states = table.good_loss_percent, table.bad_loss_percent
        if table.burst_packets is None:
            if states != (None, None):
                raise self._error(where, "good_loss_percent and bad_loss_percent need burst_packets")
            return independent(share) if share else NO_LOSS
        good = (table.good_loss_percent or 0.0) / 100
        bad = (100.0 if table.bad_loss_percent is None else table.bad_loss_percent) / 100
        try:
            return bursty(share, table.burst_packets, good=good, bad=bad)
        except ValueError as error:
            raise self._error(f"{where}.loss_percent", str(error)) from error

    def _reorder(self, where: str, table: DirectionTable) -> Reordering | None:
        if (table.reorder_percent is None) != (table.reorder_ms is None):
            raise self._error(where, "reorder_percent and reorder_ms go together")
        if table.reorder_percent is None or table.reorder_ms is None:
            return None
        return Reordering(table.reorder_percent / 100, table.reorder_ms / 1000)

    def _bottleneck(self, where: str, table: BottleneckTable | None) -> BottleneckSettings | None:
        if table is None:
            return None
        if table.queue_bytes is not None and table.queue_ms is not None:
            raise self._error(where, "has both queue_bytes and queue_ms; keep one")
        queue = table.queue_bytes or DEFAULT_QUEUE
        if table.queue_ms is not None:
            queue = int(table.rate_kbps * table.queue_ms / 8)
            if queue < 1500:
                raise self._error(f"{where}.queue_ms", "the queue holds no whole packet; make it longer")
        return BottleneckSettings(table.rate_kbps * 1000, queue)

    def _outages(self, tables: list[OutageTable], where: str) -> tuple[PlannedOutage, ...]:
        for number, table in enumerate(tables):
            if table.every_s is not None and table.every_s <= table.lasts_s:
                raise self._error(f"outage[{number}].every_s", "has to be longer than lasts_s, or it never ends")
        chosen = [table for table in tables if table.where == where]
        return tuple(PlannedOutage(table.at_s, table.lasts_s, table.every_s, table.hold) for table in chosen)


def _merged(*tables: DirectionTable) -> dict[str, object]:
    said: dict[str, object] = {}
    for table in tables:
        own = {name: value for name in DIRECTION_KEYS if (value := getattr(table, name)) is not None}
        for name in own:
            other = ALTERNATIVES.get(name)
            if other is not None and other not in own:
                said.pop(other, None)
        said |= own
    return said


DIRECTION_KEYS = DirectionTable.__struct_fields__


def _distribution(table: DelayTable, scale: float) -> Delay:
    """Return the distribution of a table.

    Raises:
        ValueError: the table does not make this shape.
    """
    given = {name: value for name in ("min", "mean", "max", "deviation") if (value := getattr(table, name)) is not None}
    needed, allowed = SHAPE_KEYS[table.shape]
    if not needed <= given.keys() <= allowed:
        raise ValueError(f"{table.shape} takes {', '.join(sorted(allowed))} and needs {', '.join(sorted(needed))}")
    scaled = {name: value * scale for name, value in given.items()}
    if table.shape == "lognormal":
        if scaled["min"] == scaled["mean"] == scaled["max"]:
            return Constant(scaled["mean"])
        return Lognormal(scaled["min"], scaled["mean"], scaled["max"])
    if table.shape == "pareto":
        return Pareto(scaled["min"], scaled["mean"], scaled["max"])
    if table.shape == "normal":
        return Normal(scaled["mean"], scaled["deviation"], scaled.get("min", 0.0))
    if scaled["max"] < scaled["min"]:
        raise ValueError("uniform needs min <= max")
    return Uniform(scaled["min"], scaled["max"])


SHAPE_KEYS: dict[str, tuple[set[str], set[str]]] = {
    "lognormal": ({"min", "mean", "max"}, {"min", "mean", "max"}),
    "pareto": ({"min", "mean", "max"}, {"min", "mean", "max"}),
    "uniform": ({"min", "max"}, {"min", "max"}),
    "normal": ({"mean", "deviation"}, {"mean", "deviation", "min"}),
}
