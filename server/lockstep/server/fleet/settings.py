"""Settings of a console with several robots."""

from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator
from pydantic_settings import BaseSettings

from lockstep.server.http.network_settings import NameList
from lockstep.server.util.robot_names import parse_robots

__all__ = ["FleetSettings"]


class FleetSettings(BaseSettings):
    """The fleet's part of `Settings`. With any robot, or a file of them, the console is a fleet's."""

    robots: NameList = ()  # "left=tcp://10.0.0.5:5600", comma-separated in the environment
    fleet_file: Path | None = None  # TOML: a table for each robot, with settings of its own
    max_total_peers: Annotated[int, Field(ge=1)] = 400  # of all robots together, thumbnails included
    max_thumbnails: Annotated[int, Field(ge=0)] = 64  # small pictures on overviews, of one robot

    @field_validator("robots", mode="before")
    @classmethod
    def _split_robots(cls, value: object) -> object:
        return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value

    @field_validator("robots")
    @classmethod
    def _check_names(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        parse_robots(value)
        return value

    @field_validator("fleet_file", mode="before")
    @classmethod
    def _no_file(cls, value: object) -> object:
        return None if value == "" else value

    @property
    def is_fleet(self) -> bool:
        return bool(self.robots) or self.fleet_file is not None
