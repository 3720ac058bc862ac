"""Access tokens: signed (JWT, HS256, RFC 7519), with a role, a name, an id and an end."""

import math
import secrets
import time
from collections.abc import Callable
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar

import jwt
import msgspec

from robot_bridge.protocol.console import Role
from server.audit import Actor
from server.errors import LinkExpired, LinkOtherRobot, LinkRevoked, NotAllowed, TokenInvalid, TokenMissing

__all__ = ["MAX_ROBOTS", "Access", "Identity", "RobotName", "bearer_token", "require_role"]

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
    link: Annotated[str, msgspec.Meta(max_length=64)]  # id of the link it was made for; it ends with it
    robot: RobotName = ""  # whose scene it opens


class _FileClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep-file"]
    exp: float
    link: Annotated[str, msgspec.Meta(max_length=64)]
    file: Annotated[str, msgspec.Meta(max_length=200)]  # the one recording that it opens
    robot: RobotName = ""  # whose recording


Claims = TypeVar("Claims", _LinkClaims, _TicketClaims, _FileClaims)

_decoders: dict[type, msgspec.json.Decoder[Any]] = {
    kind: msgspec.json.Decoder(kind) for kind in (_LinkClaims, _TicketClaims, _FileClaims)
}


def _nothing_revoked(token_id: str) -> bool:
    return False


class Access:
    """Issues and checks tokens. Who brings one that we did not sign is never told what is wrong with it.

    Args:
        is_revoked: by the id of a token
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
    ) -> None:
        self._robot = robot
        self._secret = secret
        self._token_seconds = token_seconds
        self._ticket_seconds = ticket_seconds
        self._is_revoked = is_revoked

    def at(self, robot: str | None) -> Self:
        """The same, at the door of another robot."""
        return type(self)(self._secret, self._token_seconds, self._ticket_seconds, self._is_revoked, robot)

    def issue(self, role: Role, name: str, robots: tuple[str, ...] = ()) -> str:
        """A token with a new id, for as long as the settings say."""
        now = time.time()
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
        """
        claims = self._decode(token, _LinkClaims)
        self._check(claims.jti, claims.exp)
        identity = Identity(claims.role, claims.name, claims.jti, claims.exp, claims.robots, claims.iat)
        if self._robot is not None and not identity.may_see(self._robot):
            raise LinkOtherRobot("this link is good for other robots only")
        return identity

    def bearer(self, authorization: str | None) -> Identity:
        """Whom an Authorization header stands for (RFC 6750 2.1).

        Raises:
            TokenMissing: there is no bearer token.
            AccessError: as `verify`.
        """
        token = bearer_token(authorization)
        if not token:
            raise TokenMissing("send the token as: Authorization: Bearer TOKEN")
        return self.verify(token)

    def issue_ticket(self, token_id: str = "") -> str:
        """A short-lived permission to watch the 3D scene, for the holder of the link `token_id`.

        It may stand in a path: it opens nothing else.
        """
        return self._encode(_TicketClaims("lockstep-scene", time.time() + self._ticket_seconds, token_id, self._own))

    def verify_ticket(self, ticket: str) -> str:
        """The id of the link it was made for; raises as `verify` does."""
        claims = self._decode(ticket, _TicketClaims)
        self._check(claims.link, claims.exp)
        if claims.robot != self._own:
            raise TokenInvalid(INVALID)
        return claims.link

    def issue_file_ticket(self, file: str, token_id: str) -> str:
        """A short-lived permission to download one recording, for the holder of the link `token_id`."""
        expires = time.time() + self._ticket_seconds
        return self._encode(_FileClaims("lockstep-file", expires, token_id, file, self._own))

    def verify_file_ticket(self, ticket: str, file: str) -> None:
        """Raises as `verify` does, also when it is for another file."""
        claims = self._decode(ticket, _FileClaims)
        self._check(claims.link, claims.exp)
        if claims.file != file or claims.robot != self._own:
            raise TokenInvalid(INVALID)

    @property
    def _own(self) -> str:
        return self._robot or ""

    def _check(self, token_id: str, expires: float) -> None:
        if not expires > time.time():  # also when it is not a number
            raise LinkExpired("this link has expired; ask for a new one")
        if self._is_revoked(token_id):
            raise LinkRevoked("this link was revoked")

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


def require_role(identity: Identity, *roles: Role) -> None:
    """Raises NotAllowed unless `identity` has one of `roles`."""
    if identity.role not in roles:
        raise NotAllowed(f"only the {' or the '.join(roles)} may do this")
