"""The options of every command that runs a console, as the settings that they are."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import typer

from lockstep.server.cli.options import (
    AllowedHosts,
    Board,
    Cameras,
    Config,
    Foxglove,
    Microphones,
    ObserversDirect,
    PublicUrl,
    Record,
    Relay,
    Rerun,
    Speaker,
    SpeedCap,
    StateDirOption,
    Stun,
    Tls,
    TlsCert,
    TlsKey,
    Turn,
    TurnSecret,
    Whip,
)
from lockstep.server.telemetry.logs import LogFormat

__all__ = ["ConsoleOptions"]


class Switch(StrEnum):
    ON = "on"
    OFF = "off"


Host = Annotated[str | None, typer.Option(help="Address to listen on. Default: 127.0.0.1.")]
Port = Annotated[int | None, typer.Option(min=0, max=65535, help="Port of the console; 0: any free port.")]
Json = Annotated[bool, typer.Option("--json", help="Print the links as one JSON line when the console is ready.")]
IceHosts = Annotated[
    list[str] | None,
    typer.Option("--ice-host", help="Address of this machine that browsers get for media; repeat for several."),
]
Advertise = Annotated[
    list[str] | None,
    typer.Option(help="Public address of this machine behind a 1:1 NAT, as in a cloud; repeat for several."),
]
MediaPort = Annotated[
    int | None,
    typer.Option(
        min=0, max=65535, help="UDP port for the media and data channels of all peers. Default: 0, any free port."
    ),
]
MediaTcp = Annotated[
    bool | None,
    typer.Option(
        "--media-tcp/--no-media-tcp", help="Accept media over TCP on the same port, for networks that block UDP."
    ),
]
Quality = Annotated[
    Switch | None, typer.Option(help="Adapt the bitrate, rate and size of pictures to the network. Default: on.")
]
LogFormatOption = Annotated[LogFormat | None, typer.Option("--log-format", help="Format of log lines: text or JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Log only warnings and errors.")]


@dataclass(frozen=True)
class ConsoleOptions:
    """One field for each option. None: it was not given, so the file, the environment or the default holds."""

    host: Host = None
    port: Port = None
    ice_host: IceHosts = None
    advertise: Advertise = None
    media_port: MediaPort = None
    media_tcp: MediaTcp = None
    camera: Cameras = None
    microphone: Microphones = None
    whip: Whip = None
    speaker: Speaker = None
    quality: Quality = None
    speed_cap: SpeedCap = None
    record: Record = None
    foxglove: Foxglove = None
    rerun: Rerun = None
    relay: Relay = None
    observers_direct: ObserversDirect = None
    public_url: PublicUrl = None
    allowed_host: AllowedHosts = None
    board: Board = None
    tls: Tls = None
    tls_cert: TlsCert = None
    tls_key: TlsKey = None
    stun: Stun = None
    turn: Turn = None
    turn_secret: TurnSecret = None
    as_json: Json = False
    quiet: Quiet = False
    log_format: LogFormatOption = None
    state_dir: StateDirOption = None
    config: Config = None

    def settings(self) -> dict[str, object]:
        """Return the options by the names of their settings."""
        return {
            "host": self.host,
            "port": self.port,
            "ice_hosts": self.ice_host,
            "advertise": self.advertise,
            "media_port": self.media_port,
            "media_tcp": self.media_tcp,
            "cameras": _words(self.camera),
            "microphones": _words(self.microphone),
            "whip": _words(self.whip),
            "speaker": self.speaker,
            "media": None if self.quality is None else {"quality": self.quality is Switch.ON},
            "speed_cap": self.speed_cap,
            "recording": None if self.record is None else {"directory": self.record, "automatic": True},
            "foxglove": None if self.foxglove is None else {"port": self.foxglove},
            "rerun": None if self.rerun is None else {"to": self.rerun},
            "relay": self.relay,
            "observers_direct": self.observers_direct,
            "public_url": self.public_url,
            "allowed_hosts": self.allowed_host,
            "board": self.board,
            "tls": self.tls,
            "tls_cert": self.tls_cert,
            "tls_key": self.tls_key,
            "stun": self.stun,
            "turn": self.turn,
            "turn_secret": self.turn_secret,
            "log_format": self.log_format,
            "state_dir": self.state_dir,
            "config": self.config,
        }


def _words(texts: list[str] | None) -> tuple[str, ...] | None:
    """Return the value of a setting that may be given several times, and may hold any character."""
    return tuple(texts) if texts else None
