"""The settings of each robot of a fleet: the console's, and those in the fleet's file for that robot alone."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from lockstep.protocol.files.toml_file import TomlUnusable, read_toml
from lockstep.server.settings import Settings
from lockstep.server.util.robot_names import BadFleet, check_names, parse_robots

__all__ = ["OWN", "robot_settings"]

# The settings that may differ between robots. All others concern the whole console.
OWN = frozenset(
    {
        *("robot", "link_secret", "link_secret_file", "link_tls_cert", "link_tls_key", "link_tls_ca"),
        *("cameras", "microphones", "whip", "speaker", "relay", "relay_public", "relay_codec", "observers_direct"),
        *("speed_cap", "seat_timeout", "seat_idle_seconds", "seat_claim_seconds", "observer_feedback_hz"),
        *("max_peers", "max_relayed", "max_thumbnails", "reserved_places", "scene", "scene_hz", "media", "recording"),
        *("foxglove", "rerun"),
    }
)
# A camera belongs to one robot: given to the whole console, it would show the same at every robot.
NEVER_SHARED = ("cameras", "microphones", "whip", "speaker", "relay")


def robot_settings(settings: Settings) -> dict[str, Settings]:
    """Return the settings by name, in the order in which the robots were named; first those of the flag.

    Raises:
        BadFleet: a name, the file or a robot's table in it is invalid.
    """
    shared = [name for name in NEVER_SHARED if getattr(settings, name)]
    if shared:
        raise BadFleet("setting_of_one_robot", f"{', '.join(shared)}: set this for one robot in the fleet file")
    named = [(each.name, {"robot": each.address}) for each in parse_robots(settings.robots)]
    tables = [*named, *_tables(settings).items()]
    check_names(name for name, _ in tables)
    if not tables:
        raise BadFleet("no_robots", f"{settings.fleet_file}: the file has no table [robots.NAME]")
    common = {name: getattr(settings, name) for name in settings.model_fields_set - {"robots", "fleet_file", "config"}}
    made = {name: _settings(name, common, table) for name, table in tables}
    _check_ports("foxglove_port", {name: each.foxglove.port for name, each in made.items()})
    _check_ports("rerun_port", {name: each.rerun.served_port for name, each in made.items()})
    return made


def _check_ports(problem: str, ports: Mapping[str, int | None]) -> None:
    """Raise BadFleet if two robots would serve viewers at the same port: a viewer would see one of them alone."""
    taken: dict[int, str] = {}
    for name, port in ports.items():
        if port and port in taken:
            detail = f"robots {taken[port]} and {name} have the same port {port}; give each its own in the fleet file"
            raise BadFleet(problem, detail)
        if port:
            taken[port] = name


def _settings(name: str, common: Mapping[str, Any], table: Mapping[str, Any]) -> Settings:
    foreign = sorted(set(table) - OWN)
    if foreign:
        raise BadFleet("setting_of_the_console", f"robot {name}: {', '.join(foreign)} cannot be set for one robot")
    if "robot" not in table:
        raise BadFleet("robot_without_address", f'robot {name}: the table needs robot = "tcp://host:port"')
    nested = {
        key: {**common[key].model_dump(exclude_unset=True), **value}
        for key, value in table.items()
        if isinstance(value, dict) and key in common
    }
    try:
        made = Settings(**{**common, "robots": (), "fleet_file": None, **table, **nested})
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"])) or "robot"
        raise BadFleet("bad_setting", f"robot {name}: {where}: {error.errors()[0]['msg']}") from error
    if made.recording.directory is not None and not _has_directory(table):
        own = made.recording.model_copy(update={"directory": made.recording.directory / name})
        made = made.model_copy(update={"recording": own})
    return made


def _has_directory(table: Mapping[str, Any]) -> bool:
    """Return whether the robot's recordings have a directory of their own."""
    recording = table.get("recording")
    return isinstance(recording, dict) and "directory" in recording


def _tables(settings: Settings) -> dict[str, Mapping[str, Any]]:
    if settings.fleet_file is None:
        return {}
    try:
        content, _ = read_toml(settings.fleet_file)
    except TomlUnusable as error:
        raise BadFleet("fleet_unreadable", str(error)) from error
    tables = content.pop("robots", {})
    if settings.fleet_file == settings.config:  # the console's own settings stand beside the tables
        content = {}
    if content or not isinstance(tables, dict) or not all(isinstance(each, dict) for each in tables.values()):
        raise BadFleet("fleet_unreadable", f"{settings.fleet_file}: the file may hold only tables [robots.NAME]")
    return tables
