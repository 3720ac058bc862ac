"""Access tokens: signed (JWT, HS256, RFC 7519), with a role, a name, an id and an end."""

import math
import secrets
import time
from collections.abc import Callable
from typing import Annotated, Any, Literal, NamedTuple, Protocol, Self, TypeVar

import jwt
import msgspec

from lockstep.protocol.console import Role
from lockstep.server.audit.records import Actor
from lockstep.server.errors import (
    LinkExpired,
    LinkOtherRobot,
    LinkRevoked,
    NotAllowed,
    StateUnavailable,
    TokenInvalid,
    TokenMissing,
)

__all__ = [
    "MAX_ROBOTS",
    "Access",
    "HasRole",
    "Identity",
    "Right",
    "RobotName",
    "SceneTicket",
    "bearer_token",
    "require_role",
]

ALGORITHM = "HS256"
MAX_TOKEN = 4096  # characters; ours have about 200, and 40 more for each robot that they name
MAX_ROBOTS = 32  # that one link names
INVALID = "the token is not valid"

RobotName = Annotated[str, msgspec.Meta(max_length=32)]


class Identity(NamedTuple):
    """Who a token stands for."""

    role: Role
    name: str
    token_id: str
    expires: float  # s since 1970
    robots: tuple[str, ...] = ()  # of a fleet, that it is good for; empty: all
    issued: float = math.inf  # s since 1970, when the link was made; infinite: not known

    def may_see(self, robot: str) -> bool:
        """Whether this link is good for that robot; "" is the robot of a console that has only one."""
        return not self.robots or robot in self.robots

    @property
    def actor(self) -> Actor:
        """For the audit."""
        return Actor(self.name, self.role, "", self.token_id)


class Right:
    """What somebody may do with a link, asked anew each time: whoever waits between a check and an effect checks again.

    Every attribute raises LinkExpired or LinkRevoked once the link has ended, and StateUnavailable while nobody can
    know which links are revoked.
    """

    __slots__ = ("_check", "_identity")

    def __init__(self, identity: Identity, check: Callable[[Identity], None]) -> None:
        self._identity = identity
        self._check = check

    @property
    def identity(self) -> Identity:
        self._check(self._identity)
        return self._identity

    @property
    def role(self) -> Role:
        return self.identity.role

    @property
    def name(self) -> str:
        return self.identity.name

    @property
    def token_id(self) -> str:
        return self.identity.token_id

    @property
    def actor(self) -> Actor:
        return self.identity.actor


class HasRole(Protocol):
    @property
    def role(self) -> Role: ...


class SceneTicket(NamedTuple):
    """What a ticket for the 3D scene says of the link that it was made for."""

    link: str
    role: Role
    ends: float  # s since 1970: the link's end, which an open scene does not outlive


class _LinkClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep"]
    exp: float
    iat: float
    role: Role
    name: Annotated[str, msgspec.Meta(max_length=60)]
    jti: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    robots: Annotated[tuple[RobotName, ...], msgspec.Meta(max_length=MAX_ROBOTS)] = ()


class _TicketClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep-scene"]
    exp: float
    ends: float  # when the link it was made for ends
    role: Role  # of that link
    name: Annotated[str, msgspec.Meta(max_length=60)]
    link: Annotated[str, msgspec.Meta(max_length=64)]  # id of that link
    robot: RobotName = ""  # whose scene it opens


class _FileClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep-file"]
    exp: float
    ends: float
    role: Role
    name: Annotated[str, msgspec.Meta(max_length=60)]
    link: Annotated[str, msgspec.Meta(max_length=64)]
    file: Annotated[str, msgspec.Meta(max_length=200)]  # the one recording that it opens
    robot: RobotName = ""  # whose recording


Claims = TypeVar("Claims", _LinkClaims, _TicketClaims, _FileClaims)

_decoders: dict[type, msgspec.json.Decoder[Any]] = {
    kind: msgspec.json.Decoder(kind) for kind in (_LinkClaims, _TicketClaims, _FileClaims)
}


def _nothing_revoked(token_id: str) -> bool:
    return False


def _no_trouble() -> str:
    return ""


class Access:
    """Issues and checks tokens. Who brings one that we did not sign is never told what is wrong with it.

    Args:
        is_revoked: by the id of a token
        trouble: why nobody can know which links are revoked; "" while it is known
        now: s since 1970
        robot: whose door this is: only links that are good for it pass, and tickets open nothing of another one's;
            "": the only robot of a console, None: the fleet's own door, which every good link passes
    """

    def __init__(
        self,
        secret: str,
        token_seconds: float,
        ticket_seconds: float,
        is_revoked: Callable[[str], bool] = _nothing_revoked,
        robot: str | None = "",
        trouble: Callable[[], str] = _no_trouble,
        now: Callable[[], float] = time.time,
    ) -> None:
        self._robot = robot
        self._trouble = trouble
        self._now = now
        self._secret = secret
        self._token_seconds = token_seconds
        self._ticket_seconds = ticket_seconds
        self._is_revoked = is_revoked

    def at(self, robot: str | None) -> Self:
        """The same, at the door of another robot."""
        known = (self._is_revoked, robot, self._trouble, self._now)
        return type(self)(self._secret, self._token_seconds, self._ticket_seconds, *known)

    def issue(self, role: Role, name: str, robots: tuple[str, ...] = ()) -> str:
        """A token with a new id, for as long as the settings say."""
        now = self._now()
        return self.sign(Identity(role, name, secrets.token_hex(8), now + self._token_seconds, robots), now)

    def sign(self, identity: Identity, issued: float) -> str:
        """The token that stands for `identity`; the same one whenever the arguments are."""
        role, name, token_id, expires, robots = identity[:5]
        return self._encode(_LinkClaims("lockstep", expires, issued, role, name, token_id, robots))

    def verify(self, token: str) -> Identity:
        """Whom `token` stands for.

        Raises:
            TokenInvalid: not a token of this console.
            LinkExpired, LinkRevoked: it was one.
            LinkOtherRobot: it is one, for other robots.
            StateUnavailable: nobody can know whether it is revoked.
        """
        identity = self._identity(token)
        self.check(identity)
        return identity

    def check(self, identity: Identity) -> None:
        """Raises as `verify` does when the link of `identity` is good no more."""
        self._check_link(identity.token_id, identity.expires)
        self._check_list()

    def bearer(self, authorization: str | None) -> Right:
        """What an Authorization header (RFC 6750 2.1) gives the right to.

        Raises:
            TokenMissing: there is no bearer token.
            AccessError, StateUnavailable: as `verify`.
        """
        right = Right(self._identity(_required_token(authorization)), self.check)
        right.identity  # noqa: B018  raises
        return right

    def bearer_to_stop(self, authorization: str | None) -> Right:
        """As `bearer`, but good also while nobody can know which links are revoked: a stop must not wait for a disk."""
        right = Right(
            self._identity(_required_token(authorization)),
            lambda identity: self._check_link(identity.token_id, identity.expires),
        )
        right.identity  # noqa: B018  raises
        return right

    def issue_ticket(self, holder: Identity) -> str:
        """A short-lived permission to open the 3D scene, for the holder of a link. It ends no later than the link.

        It may stand in a path: it opens nothing else.
        """
        return self._encode(_TicketClaims("lockstep-scene", *self._ticket_for(holder), self._own))

    def verify_ticket(self, ticket: str) -> SceneTicket:
        """The link it was made for; raises as `verify` does."""
        claims = self._decode(ticket, _TicketClaims)
        self._check_ticket(claims)
        return SceneTicket(claims.link, claims.role, claims.ends)

    def issue_file_ticket(self, file: str, holder: Identity) -> str:
        """A short-lived permission to download one recording, for the holder of a link."""
        return self._encode(_FileClaims("lockstep-file", *self._ticket_for(holder), file, self._own))

    def verify_file_ticket(self, ticket: str, file: str) -> Right:
        """The right of the link it was made for; raises as `verify` does, also when it is for another file."""
        claims = self._decode(ticket, _FileClaims)
        self._check_ticket(claims)
        if claims.file != file:
            raise TokenInvalid(INVALID)
        return Right(Identity(claims.role, claims.name, claims.link, claims.ends), self.check)

    def _identity(self, token: str) -> Identity:
        claims = self._decode(token, _LinkClaims)
        self._check_link(claims.jti, claims.exp)
        identity = Identity(claims.role, claims.name, claims.jti, claims.exp, claims.robots, claims.iat)
        if self._robot is not None and not identity.may_see(self._robot):
            raise LinkOtherRobot("this link is good for other robots only")
        return identity

    def _ticket_for(self, holder: Identity) -> tuple[float, float, Role, str, str]:
        expires = min(self._now() + self._ticket_seconds, holder.expires)
        return expires, holder.expires, holder.role, holder.name, holder.token_id

    def _check_ticket(self, claims: _TicketClaims | _FileClaims) -> None:
        self._check_link(claims.link, min(claims.exp, claims.ends))
        self._check_list()
        if claims.robot != self._own:
            raise TokenInvalid(INVALID)

    @property
    def _own(self) -> str:
        return self._robot or ""

    def _check_link(self, token_id: str, expires: float) -> None:
        if not expires > self._now():  # also when it is not a number
            raise LinkExpired("this link has expired; ask for a new one")
        if self._is_revoked(token_id):
            raise LinkRevoked("this link was revoked")

    def _check_list(self) -> None:
        if trouble := self._trouble():
            raise StateUnavailable(f"the console cannot read which links are revoked, so it lets nobody in: {trouble}")

    def _encode(self, claims: _LinkClaims | _TicketClaims | _FileClaims) -> str:
        return jwt.encode(msgspec.to_builtins(claims), self._secret, ALGORITHM)

    def _decode(self, token: str, kind: type[Claims]) -> Claims:
        """The claims, strictly: exactly these, of these types. PyJWT only checks the signature."""
        try:
            if len(token) > MAX_TOKEN:
                raise TokenInvalid(INVALID)
            payload = jwt.api_jws.decode(token, self._secret, algorithms=[ALGORITHM])
            claims: Claims = _decoders[kind].decode(payload)
            return claims
        except (jwt.InvalidTokenError, msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise TokenInvalid(INVALID) from error


def bearer_token(authorization: str | None) -> str:
    """The token in an Authorization header (RFC 6750 2.1); "" when there is none."""
    scheme, _, token = (authorization or "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else ""


def _required_token(authorization: str | None) -> str:
    token = bearer_token(authorization)
    if not token:
        raise TokenMissing("send the token as: Authorization: Bearer TOKEN")
    return token


def require_role(caller: HasRole, *roles: Role) -> None:
    """Raises NotAllowed unless `caller` has one of `roles`."""
    if caller.role not in roles:
        raise NotAllowed(f"only the {' or the '.join(roles)} may do this")
