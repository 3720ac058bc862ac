"""Options of the command line that several commands share; each is a setting too (LOCKSTEP_…)."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "AllowedHosts",
    "Board",
    "Cameras",
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


RobotOption = Annotated[str, typer.Option(help="Of this robot of a fleet.")]
StateDirOption = Annotated[Path | None, typer.Option(help="The console's state directory.")]


class SpeedCapChoice(StrEnum):
    ON = "on"
    OFF = "off"
    OPERATOR = "operator"


PublicUrl = Annotated[str | None, typer.Option(help="Where people find the console, as behind a proxy.")]
AllowedHosts = Annotated[
    list[str] | None,
    typer.Option("--allowed-host", help="Further name that requests may be for; may be given again."),
]
Board = Annotated[
    str | None,
    typer.Option(
        help="Redis that several consoles behind one entry share, redis[s]://:password@host:port/0. With a password "
        "better in the environment or a file. docs/fleet.md",
        metavar="URL",
    ),
]
Tls = Annotated[str | None, typer.Option(help="self-signed: encrypt with a certificate of the console's own making.")]
TlsCert = Annotated[Path | None, typer.Option(help="Certificate chain for TLS, PEM.")]
TlsKey = Annotated[Path | None, typer.Option(help="Its private key, PEM.")]
Stun = Annotated[list[str] | None, typer.Option(help="stun:host[:port]; may be given again.")]
Turn = Annotated[
    list[str] | None, typer.Option(help="turn:host[:port][?transport=udp|tcp]; may be given again.", metavar="URI")
]
TurnSecret = Annotated[str | None, typer.Option(help="Secret shared with the TURN server. Better in the environment.")]
SpeedCap = Annotated[
    SpeedCapChoice | None,
    typer.Option(help="Cap the speed by the delay of what the operator sees: always, never, or as the operator wants."),
]
Cameras = Annotated[
    list[str] | None,
    typer.Option(
        "--camera",
        help="A camera of the console's own, [name=]rtsp://…, v4l2:/dev/video0, udp://…, file:…; may be given again. "
        "docs/media.md has the options.",
        metavar="SOURCE",
    ),
]
Microphones = Annotated[
    list[str] | None,
    typer.Option(
        "--microphone",
        help="A microphone of the console's own, [name=]pulse:, alsa:hw:1, rtsp://…, file:…; may be given again.",
        metavar="SOURCE",
    ),
]
Whip = Annotated[
    list[str] | None,
    typer.Option(
        "--whip",
        help="A camera that operators may publish by WHIP, from a phone, OBS or GStreamer: NAME[#label=…,latency=s]; "
        "may be given again. docs/media.md",
        metavar="NAME",
    ),
]
Relay = Annotated[
    list[str] | None,
    typer.Option(
        help="Observers beyond --observers-direct watch through it: janus:ws://host:8188/ROOM; "
        "may be given again, then the first feeds the others. docs/relay.md",
        metavar="janus:URL",
    ),
]
ObserversDirect = Annotated[
    int | None, typer.Option(min=0, help="Observers that the console serves itself when it has a relay; 10 unless set.")
]
Record = Annotated[
    Path | None, typer.Option("--record", help="Record from the start on, into this directory.", metavar="DIR")
]
Speaker = Annotated[
    str | None,
    typer.Option(
        help="Loudspeaker at the robot for the voice of who drives: pulse:[sink], alsa:device, file:path.wav.",
        metavar="OUTPUT",
    ),
]
