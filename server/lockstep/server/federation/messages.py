"""The consoles' values in the store and messages to each other, with the bounds that readers check. No I/O."""

from dataclasses import dataclass
from typing import Annotated, Literal, TypeVar

import msgspec
from pydantic import Field, TypeAdapter, ValidationError

from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.silenced_links import MAX_SILENCED
from lockstep.server.federation.board import SharedRecord
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import InputMalformed
from lockstep.server.federation.robot_summary import ROBOT_NAME, Name, Tile, Words

__all__ = [
    "MAX_AUDIT_LINE",
    "MAX_NEWS",
    "MAX_PUBLISHED",
    "MAX_ROBOTS",
    "Changed",
    "ConsoleId",
    "Gone",
    "News",
    "Outcome",
    "Published",
    "Revoked",
    "RevokedLink",
    "SilencedLink",
    "StopReply",
    "StopRequest",
    "pack_news",
    "pack_published",
    "pack_record",
    "pack_revoked",
    "unpack_news",
    "unpack_published",
    "unpack_record",
    "unpack_revoked",
]

MAX_ROBOTS = 64  # of one console
MAX_PUBLISHED = 256 * 1024  # bytes of one console's state
MAX_NEWS = 16 * 1024
MAX_AUDIT_LINE = 8 * 1024

ConsoleId = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
RequestId = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
RobotName = Annotated[str, Field(pattern=ROBOT_NAME)]


@dataclass(frozen=True, kw_only=True)
class SilencedLink:
    """A link whose stops a supervisor has silenced."""

    id: Annotated[str, Field(min_length=1, max_length=64, pattern=r"^\S+$")]
    until: Annotated[float, Field(ge=0, allow_inf_nan=False)]  # s since 1970


@dataclass(frozen=True, kw_only=True)
class Published:
    """The state of one console."""

    id: ConsoleId
    name: Name  # for people
    n: Annotated[int, Field(ge=1, lt=2**53)]  # counts up; an old number is no sign of life
    robots: Annotated[tuple[Tile, ...], Field(max_length=MAX_ROBOTS)]
    silenced: Annotated[tuple[SilencedLink, ...], Field(max_length=MAX_SILENCED)] = ()


@dataclass(frozen=True, kw_only=True)
class Changed:
    """The state of `console` has changed: look at it."""

    console: ConsoleId
    kind: Literal["changed"] = "changed"


@dataclass(frozen=True, kw_only=True)
class Gone:
    """`console` ended in good order."""

    console: ConsoleId
    kind: Literal["gone"] = "gone"


@dataclass(frozen=True, kw_only=True)
class RevokedLink:
    id: Annotated[str, Field(min_length=1, max_length=64, pattern=r"^\S+$")]
    expires: Annotated[float, Field(ge=0, allow_inf_nan=False)]  # s since 1970; not needed for longer


@dataclass(frozen=True, kw_only=True)
class Revoked:
    """The list of revoked links has new entries."""

    console: ConsoleId
    kind: Literal["revoked"] = "revoked"


@dataclass(frozen=True, kw_only=True)
class StopRequest:
    """STOP for robots of other consoles; a console that has one of them obeys and answers."""

    console: ConsoleId  # the console that asks
    request: RequestId
    robots: Annotated[tuple[RobotName, ...], Field(max_length=MAX_ROBOTS * 8)]
    by: Name
    role: Name
    link: Annotated[str, Field(max_length=64)]
    reason: Words
    press: Annotated[str, Field(max_length=64)] = ""  # "": from a console that does not know of presses
    kind: Literal["stop"] = "stop"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    robot: RobotName
    delivered: bool
    event: Annotated[int, Field(ge=0, lt=2**31)]
    number: Annotated[int, Field(ge=0, lt=2**53)] = 0  # of the stop; 0 when it was not delivered
    detail: Words = ""  # reason that it was not delivered
    kept: bool = False  # on the robot's disk; also false from a console that does not say


@dataclass(frozen=True, kw_only=True)
class StopReply:
    console: ConsoleId  # the console that answers
    request: RequestId
    robots: Annotated[tuple[Outcome, ...], Field(max_length=MAX_ROBOTS)]
    kind: Literal["stopped"] = "stopped"


News = Changed | Gone | Revoked | StopRequest | StopReply
Kept = TypeVar("Kept")

_published = TypeAdapter(Published)
_news: TypeAdapter[News] = TypeAdapter(Annotated[News, Field(discriminator="kind")])
_revoked = TypeAdapter(RevokedLink)
_robot_name = TypeAdapter(RobotName)
_console_name = TypeAdapter(Name)
_record = msgspec.json.Decoder(AuditRecord)


def pack_published(seal: Seal, published: Published) -> bytes:
    return seal.put("console", msgspec.json.encode(published))


def unpack_published(seal: Seal, sealed: bytes) -> Published:
    """Check and decode a sealed state. Raises BoardInput, as all unpack functions do."""
    return _checked(_published, seal.take("console", sealed, MAX_PUBLISHED))


def pack_news(seal: Seal, news: News) -> bytes:
    return seal.put("news", msgspec.json.encode(news))


def unpack_news(seal: Seal, sealed: bytes) -> News:
    return _checked(_news, seal.take("news", sealed, MAX_NEWS))


def pack_revoked(seal: Seal, link: RevokedLink) -> bytes:
    return seal.put("revoked", msgspec.json.encode(link))


def unpack_revoked(seal: Seal, sealed: bytes) -> RevokedLink:
    return _checked(_revoked, seal.take("revoked", sealed, 256))


def pack_record(seal: Seal, console: str, robot: str, record: AuditRecord) -> dict[bytes, bytes]:
    """Return the fields of an entry; `line` is the very line of the audit's file."""
    line = msgspec.json.encode(record)
    fields = {b"console": console.encode(), b"robot": robot.encode(), b"line": line}
    return {**fields, b"seal": seal.of("audit", b"\n".join(fields.values()))}


def unpack_record(seal: Seal, fields: dict[bytes, bytes]) -> SharedRecord:
    try:
        console, robot, line = fields[b"console"], fields[b"robot"], fields[b"line"]
        seal.take("audit", fields[b"seal"] + b"\n".join((console, robot, line)), MAX_AUDIT_LINE)
        return SharedRecord(
            console=_console_name.validate_python(console.decode()),
            robot=_robot_name.validate_python(robot.decode()),
            record=_record.decode(line),
        )
    except (KeyError, ValidationError, msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise InputMalformed(f"audit: {_first_fault(error)}") from error


def _checked(adapter: TypeAdapter[Kept], text: bytes) -> Kept:
    try:
        return adapter.validate_json(text, strict=True)
    except (ValidationError, UnicodeError, RecursionError) as error:
        raise InputMalformed(_first_fault(error)) from error


def _first_fault(error: Exception) -> str:
    """Return the first fault and its place; never the input itself, which may be anything."""
    if isinstance(error, ValidationError):
        fault = error.errors(include_url=False, include_input=False, include_context=False)[0]
        return f"{'.'.join(map(str, fault['loc']))}: {fault['type']}"[:200]
    return type(error).__name__
