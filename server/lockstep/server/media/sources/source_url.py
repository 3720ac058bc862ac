"""Parses `--camera` and `--microphone`: the address of a medium, and the options for reading it. No I/O.

`[name=]scheme:rest[#option=value,option=value]`, as in `front=rtsp://user:secret@10.0.0.7/main#latency=0.25`. The
options stand where a URL has its fragment, which is never sent anywhere. A `#` of the address itself is written %23.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any, Literal, NamedTuple
from urllib.parse import unquote

__all__ = ["DEVICES", "BadSource", "SourceSpec", "parse_source", "parse_sources"]

Kind = Literal["video", "audio"]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
SCHEME = re.compile(r"[a-z][a-z0-9+.-]*")
DEVICES: Mapping[str, Kind] = {"v4l2": "video", "alsa": "audio", "pulse": "audio"}
# s that the quickest may take from capture to arrival. Too large a value only makes stamps older.
LATENCY = {"v4l2": 0.05, "alsa": 0.02, "pulse": 0.02, "file": 0.0, "rtsp": 0.3, "rtsps": 0.3}
NETWORK_LATENCY = 0.2
MAX_LATENCY = 10.0
MOST = 8  # sources of one kind


class BadSource(ValueError):
    """A source is not valid. The text never repeats the input, which may hold a password."""


class SourceSpec(NamedTuple):
    """One attached camera or microphone."""

    kind: Kind
    name: str  # "front": of the stream
    label: str  # "Front": for people
    scheme: str  # "rtsp"
    address: str  # a path, a device, or a whole URL to open. May hold a password: never to be logged or shown
    latency: float  # s from capture to arrival, of the quickest
    rate: float | None = None  # pictures, or samples, per second; None: as they come
    size: tuple[int, int] | None = None  # of pictures; None: as they come
    channels: int = 1  # of a sound device
    form: str = ""  # requested of a v4l2 device: "mjpeg", "h264", "yuyv422"; "": its own choice
    transport: str = "tcp"  # of RTSP
    passing: bool = True  # True: H.264 may be passed on unchanged

    def __repr__(self) -> str:
        return f"SourceSpec({self.kind} {self.name!r} from {self.scheme})"

    @property
    def live(self) -> bool:
        """True if media were captured just before they come, which those of a file were not."""
        return self.scheme != "file"


def parse_sources(kind: Kind, texts: Iterable[str]) -> tuple[SourceSpec, ...]:
    """Parse the sources of one kind; each has a different name.

    Raises:
        BadSource: one is not valid, or there are too many.
    """
    given = list(texts)
    if len(given) > MOST:
        raise BadSource(f"more than {MOST} sources")
    found: list[SourceSpec] = []
    for number, text in enumerate(given, 1):
        try:
            spec = parse_source(kind, text, number)
        except BadSource as error:
            raise BadSource(f"number {number}: {error}") from None
        if spec.name in (each.name for each in found):
            raise BadSource(f"number {number}: the name {spec.name} is used twice")
        found.append(spec)
    return tuple(found)


def parse_source(kind: Kind, text: str, number: int = 1) -> SourceSpec:
    """Parse a source; `number` makes a name for one that has none.

    Raises:
        BadSource: it is not valid.
    """
    name, separator, rest = text.strip().partition("=")
    if not separator or not NAME.fullmatch(name):
        name, rest = "", text.strip()
    where, _, after = rest.partition("#")
    scheme, colon, path = where.partition(":")
    scheme = scheme.lower()
    if not colon or not SCHEME.fullmatch(scheme) or not (path or scheme == "pulse"):
        raise BadSource("not [name=]scheme:address, as in front=rtsp://10.0.0.7/main or v4l2:/dev/video0")
    if DEVICES.get(scheme, kind) != kind:
        raise BadSource(f"{scheme} gives no {'pictures' if kind == 'video' else 'sound'}")
    own = scheme in DEVICES or scheme == "file"
    if not own and not path.startswith("//"):
        raise BadSource(f"{scheme} needs a URL, {scheme}://…")
    word = "camera" if kind == "video" else "microphone"
    options = _options(after)
    label = options.pop("label", "") or (name or f"{word} {number}").replace("_", " ").capitalize()
    spec = SourceSpec(
        kind=kind,
        name=name or f"{word}{number}",
        label=label[:60],
        scheme=scheme,
        address=unquote(path) if own else where,
        latency=LATENCY.get(scheme, NETWORK_LATENCY),
    )
    return spec._replace(**_read_options(spec, options))


def _options(text: str) -> dict[str, str]:
    options = {}
    for part in filter(None, text.split(",")):
        name, separator, value = part.partition("=")
        if not separator:
            raise BadSource(f"the option {name[:20]!r} has no value")
        options[name.strip()] = unquote(value.strip())
    return options


def _read_options(spec: SourceSpec, options: Mapping[str, str]) -> dict[str, Any]:
    allowed = {"latency", "rate"} | ({"size", "pass"} if spec.kind == "video" else {"channels"})
    allowed |= {"format"} if spec.scheme == "v4l2" else set()
    allowed |= {"transport"} if spec.scheme in ("rtsp", "rtsps") else set()
    found: dict[str, Any] = {}
    for name, value in options.items():
        if name not in allowed:
            raise BadSource(f"no option {name[:20]!r} here; there are label, {', '.join(sorted(allowed))}")
        if name == "latency":
            found["latency"] = _number(name, value, 0.0, MAX_LATENCY)
        elif name == "rate":
            found["rate"] = _number(name, value, 1, 120) if spec.kind == "video" else _number(name, value, 8000, 48000)
        elif name == "channels":
            found["channels"] = int(_number(name, value, 1, 2))
        elif name == "size":
            found["size"] = _size(value)
        elif name == "pass":
            found["passing"] = _choice(name, value, "on", "off") == "on"
        elif name == "transport":
            found["transport"] = _choice(name, value, "tcp", "udp")
        else:
            found["form"] = value
    return found


def _number(name: str, value: str, least: float, most: float) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not least <= number <= most:
        raise BadSource(f"{name} must be a number from {least:g} to {most:g}")
    return number


def _choice(name: str, value: str, *choices: str) -> str:
    if value not in choices:
        raise BadSource(f"{name} is {' or '.join(choices)}")
    return value


def _size(value: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{2,4})x(\d{2,4})", value)
    if match is None or int(match[1]) % 2 or int(match[2]) % 2:
        raise BadSource("size must be two even numbers of pixels, as in 1280x720")
    return int(match[1]), int(match[2])
