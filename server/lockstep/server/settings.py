"""Settings of the console: a TOML file, overridden by environment variables LOCKSTEP_*, overridden by flags."""

import ipaddress
from pathlib import Path
from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from lockstep.protocol.console import SpeedCapMode
from lockstep.protocol.errors import SecretError
from lockstep.server.federation.settings import BoardSettings
from lockstep.server.fleet.settings import FleetSettings
from lockstep.server.foxglove.settings import FoxgloveSettings
from lockstep.server.http.limit_settings import LimitSettings
from lockstep.server.http.network_settings import NameList, NetworkSettings
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.sources.source_settings import SourceSettings
from lockstep.server.recording.episodes.settings import EpisodeSettings
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.rerun.settings import RerunSettings
from lockstep.server.robot.credentials import link_access
from lockstep.server.robot.dial_in import DIAL_IN
from lockstep.server.settings_file import SettingsFileSource
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.telemetry.logs import LogFormat
from lockstep.server.util.robot_names import is_named

__all__ = ["Settings"]

MIN_SECRET_BYTES = 32  # RFC 7518 3.2: an HS256 key is at least as long as the hash


class Settings(NetworkSettings, LimitSettings, SourceSettings, RelaySettings, FleetSettings, BoardSettings):
    """All settings of the console. Times are in seconds."""

    model_config = SettingsConfigDict(env_prefix="LOCKSTEP_", env_nested_delimiter="__", frozen=True, extra="ignore")

    config: Path | None = None  # TOML file of settings; those of the environment and of flags go before it
    host: str = "127.0.0.1"  # address that HTTP listens on
    port: Annotated[int, Field(ge=0, le=65535)] = 8000  # 0: any free port
    robot: str = "tcp://127.0.0.1:5600"  # the robot bridge; tls://host:port where it speaks TLS; dial-in: it comes
    link_secret: SecretStr | None = None  # the secret that the bridge asks for
    link_secret_file: Path | None = None  # file with the link secret; takes precedence
    link_tls_cert: Path | None = None  # client certificate, for a bridge that asks for one
    link_tls_key: Path | None = None
    link_tls_ca: Path | None = None  # CA of the bridge's certificate; None: the CAs that this machine trusts
    ice_hosts: NameList = ()  # addresses of this machine for media; empty: all interfaces, and loopback if bound to it
    advertise: NameList = ()  # outer addresses of this machine, where it is behind a one-to-one NAT
    media_port: Annotated[int, Field(ge=0, le=65535)] = 0  # UDP, for the media of all peers; 0: any free port
    media_tcp: bool = False  # peers may also connect to the media port by TCP (RFC 6544)
    allowed_origins: NameList = ()  # other origins whose pages may use the HTTP API, "https://example.org"
    log_format: LogFormat = LogFormat.TEXT
    state_dir: Path | None = None  # signing key, invitations, audit log; None: ~/.local/state/lockstep
    secret: SecretStr | None = None  # key that signs the links; None: a key in the state directory
    token_seconds: Annotated[float, Field(gt=0)] = 7 * 24 * 3600.0

    observer_feedback_hz: Annotated[float, Field(gt=0, le=100)] = 12.5
    audit_bytes: Annotated[int, Field(ge=4096)] = 10_000_000  # size of one file of the audit log
    audit_files: Annotated[int, Field(ge=1, le=1000)] = 10  # files that are kept; then the oldest is deleted
    audit_anchor: Path | None = None  # folder or file for signed heads of the audit; None: beside the recordings
    seat_timeout: Annotated[float, Field(gt=0)] = 3.0  # silence until the seat is free and the robot rests
    seat_idle_seconds: Annotated[float, Field(gt=0)] = 300.0  # idle time (no intention to move) until the seat is free
    seat_claim_seconds: Annotated[float, Field(gt=0)] = 60.0  # until a claim on the seat counts as declined
    speed_cap: SpeedCapMode = "operator"  # cap on the speed by the delay of the operator's view
    peer_silence: Annotated[float, Field(gt=0)] = 20.0  # silence until a peer with data channels is closed
    peer_connect_timeout: Annotated[float, Field(gt=0)] = 40.0  # from the answer to the connection
    max_peers: Annotated[int, Field(ge=1)] = 200
    max_message_rate: Annotated[float, Field(gt=0)] = 200.0  # Hz per peer; a stop is never limited
    max_sdp_bytes: Annotated[int, Field(ge=1024)] = 64 * 1024
    link_backoff: Annotated[float, Field(gt=0)] = 0.1  # first wait before the robot link is tried again
    link_backoff_cap: Annotated[float, Field(gt=0)] = 2.0

    scene: bool = True  # serve the 3D view
    scene_hz: Annotated[float, Field(gt=0, le=60)] = 15.0
    scene_ticket_seconds: Annotated[float, Field(gt=0)] = 600.0
    max_scene_viewers: Annotated[int, Field(ge=1)] = 20

    force_feedback: bool = False  # pages may use WebHID, for joysticks that push back

    media: MediaSettings = MediaSettings()
    recording: RecordingSettings = RecordingSettings()
    episodes: EpisodeSettings = EpisodeSettings()
    foxglove: FoxgloveSettings = FoxgloveSettings()
    rerun: RerunSettings = RerunSettings()

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Return where settings come from, the first one first: flags, the environment, the file."""
        return init_settings, env_settings, SettingsFileSource(settings_cls, init_settings, env_settings)

    @model_validator(mode="before")
    @classmethod
    def _robot_with_a_name(cls, given: dict[str, object]) -> dict[str, object]:
        """Accept the values of the flag --robot in LOCKSTEP_ROBOT: NAME=address is a robot of a fleet."""
        robot = given.get("robot")
        if isinstance(robot, str) and is_named(robot):
            rest = {name: value for name, value in given.items() if name != "robot"}
            return {"robots": robot, **rest}
        return given

    @field_validator("ice_hosts", "advertise", "allowed_origins", mode="before")
    @classmethod
    def _split_list(cls, value: object) -> object:
        return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value

    @field_validator("ice_hosts", "advertise")
    @classmethod
    def _check_addresses(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for address in value:
            ipaddress.ip_address(address)
        return value

    @field_validator(
        *("config", "secret", "state_dir", "audit_anchor", "link_secret", "link_secret_file"), mode="before"
    )
    @classmethod
    def _empty_is_unset(cls, value: object) -> object:
        return None if value == "" else value

    @field_validator("secret")
    @classmethod
    def _check_secret(cls, value: SecretStr | None) -> SecretStr | None:
        if value is not None and len(value.get_secret_value().encode()) < MIN_SECRET_BYTES:
            raise ValueError(f"at least {MIN_SECRET_BYTES} bytes are needed")
        return value

    @model_validator(mode="after")
    def _check_robot(self) -> Self:
        parts = urlsplit(self.robot)
        if self.dials_in:
            pass
        elif parts.scheme not in ("tcp", "tls") or not parts.hostname or not parts.port:
            raise ValueError(f"{self.robot!r} is not tcp://host:port, tls://host:port or {DIAL_IN}")
        try:
            link_access(self)
        except SecretError as error:
            raise ValueError(error.detail) from error
        return self

    @property
    def dials_in(self) -> bool:
        """True if the robot connects to the console."""
        return self.robot == DIAL_IN

    @property
    def robot_uses_tls(self) -> bool:
        return urlsplit(self.robot).scheme == "tls"

    @property
    def robot_host(self) -> str:
        return urlsplit(self.robot).hostname or ""

    @property
    def robot_port(self) -> int:
        return urlsplit(self.robot).port or 0

    @property
    def bound_to_loopback(self) -> bool:
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False
