"""Options of the command line that several commands share; each is a setting too (LOCKSTEP_…)."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "AllowedHosts",
    "Board",
    "Cameras",
    "Config",
    "Foxglove",
    "Rerun",
    "Microphones",
    "ObserversDirect",
    "PublicUrl",
    "Speaker",
    "Record",
    "Relay",
    "RobotOption",
    "SpeedCap",
    "StateDirOption",
    "Stun",
    "Tls",
    "TlsCert",
    "TlsKey",
    "Turn",
    "TurnSecret",
    "Whip",
]


RobotOption = Annotated[str, typer.Option(help="The robot of the fleet that the command is about.")]
StateDirOption = Annotated[Path | None, typer.Option(help="The console's state directory.")]


class SpeedCapChoice(StrEnum):
    ON = "on"
    OFF = "off"
    OPERATOR = "operator"


Config = Annotated[
    Path | None, typer.Option(help="TOML file of settings; flags and the environment override it. docs/deploy.md")
]
PublicUrl = Annotated[str | None, typer.Option(help="The console's public address, such as that of a reverse proxy.")]
AllowedHosts = Annotated[
    list[str] | None,
    typer.Option("--allowed-host", help="Another host name that the console answers to; repeat for several."),
]
Board = Annotated[
    str | None,
    typer.Option(
        help="Redis that several consoles behind one entry share, redis\\[s]://:password@host:port/0. The environment "
        "or a file is a safer place for the password. docs/fleet.md",
        metavar="URL",
    ),
]
Tls = Annotated[str | None, typer.Option(help="self-signed: encrypt with a certificate that the console makes itself.")]
TlsCert = Annotated[Path | None, typer.Option(help="Certificate chain for TLS, PEM.")]
TlsKey = Annotated[Path | None, typer.Option(help="Private key of that certificate, PEM.")]
Stun = Annotated[list[str] | None, typer.Option(help="STUN server, stun:host[:port]; repeat for several.")]
Turn = Annotated[
    list[str] | None,
    typer.Option(help="TURN server, turn:host[:port][?transport=udp|tcp]; repeat for several.", metavar="URI"),
]
TurnSecret = Annotated[
    str | None, typer.Option(help="Secret shared with the TURN server. The environment is a safer place for it.")
]
SpeedCap = Annotated[
    SpeedCapChoice | None,
    typer.Option(
        help="Cap the speed by the delay of the operator's pictures: always, never, or as the operator chooses."
    ),
]
Cameras = Annotated[
    list[str] | None,
    typer.Option(
        "--camera",
        help="A camera attached to the console: \\[name=]rtsp://…, v4l2:/dev/video0, udp://…, file:…; repeat for "
        "several. docs/media.md has the options.",
        metavar="SOURCE",
    ),
]
Microphones = Annotated[
    list[str] | None,
    typer.Option(
        "--microphone",
        help="A microphone attached to the console: \\[name=]pulse:, alsa:hw:1, rtsp://…, file:…; repeat for several.",
        metavar="SOURCE",
    ),
]
Whip = Annotated[
    list[str] | None,
    typer.Option(
        "--whip",
        help="A camera that operators may publish by WHIP, from a phone, OBS or GStreamer: NAME\\[#label=…,latency=s]; "
        "repeat for several. docs/media.md",
        metavar="NAME",
    ),
]
Relay = Annotated[
    list[str] | None,
    typer.Option(
        help="Relay for the observers beyond --observers-direct: janus:ws://host:8188/ROOM; repeat for several, of "
        "which the first feeds the others. docs/relay.md",
        metavar="janus:URL",
    ),
]
ObserversDirect = Annotated[
    int | None, typer.Option(min=0, help="Observers that the console serves itself when it has a relay. Default: 10.")
]
Record = Annotated[
    Path | None, typer.Option("--record", help="Record from the start, into this directory.", metavar="DIR")
]
Foxglove = Annotated[
    int | None,
    typer.Option(
        "--foxglove",
        min=0,
        max=65535,
        help="Serve the session live to Foxglove and Lichtblick, on this port of 127.0.0.1 (8765 is what they try "
        "first). Whoever reaches the port sees everything. docs/foxglove.md",
        metavar="PORT",
    ),
]
Rerun = Annotated[
    str | None,
    typer.Option(
        "--rerun",
        help="Send the session live to a viewer of Rerun (127.0.0.1:9876 is where it listens), or into a file. "
        "docs/rerun.md",
        metavar="HOST:PORT|FILE.rrd",
    ),
]
Speaker = Annotated[
    str | None,
    typer.Option(
        help="Loudspeaker at the robot, for the driver's voice: pulse:\\[sink], alsa:device, file:path.wav.",
        metavar="OUTPUT",
    ),
]
