"""Access tokens: signed, with a role, a name, an id and an expiry time."""

import math
import secrets
import time
from collections.abc import Callable
from copy import copy
from typing import NamedTuple, Protocol, Self

from lockstep.protocol.console import Role
from lockstep.server.audit.records import Actor
from lockstep.server.auth.token_signer import INVALID, FileClaims, LinkClaims, TicketClaims, TokenSigner
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
    "Access",
    "HasRole",
    "Identity",
    "Right",
    "SceneTicket",
    "bearer_token",
    "require_role",
]


class Identity(NamedTuple):
    """The holder of a token."""

    role: Role
    name: str
    token_id: str
    expires: float  # s since 1970
    robots: tuple[str, ...] = ()  # robots of a fleet that it is good for; empty: all
    issued: float = math.inf  # s since 1970, when the link was made; infinite: not known

    def may_see(self, robot: str) -> bool:
        """True if this link is good for that robot; "" is the robot of a console that has only one."""
        return not self.robots or robot in self.robots

    @property
    def actor(self) -> Actor:
        """The actor for the audit."""
        return Actor(self.name, self.role, "", self.token_id)


class Right:
    """The rights of a link, checked at every access: code that waits between a check and an effect checks again.

    Every attribute raises LinkExpired or LinkRevoked once the link has ended, and StateUnavailable while it is unknown
    which links are revoked.
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
    """The link that a ticket for the 3D scene was made for."""

    link: str
    role: Role
    ends: float  # s since 1970: the link's end, which an open scene does not outlive


def _nothing_revoked(token_id: str) -> bool:
    return False


def _no_trouble() -> str:
    return ""


class LinkCheck:
    """Whether links are good now.

    Args:
        is_revoked: True for the id of a revoked token
        trouble: the reason while it is unknown which links are revoked, else ""
        now: s since 1970
    """

    def __init__(self, is_revoked: Callable[[str], bool], trouble: Callable[[], str], now: Callable[[], float]) -> None:
        self._is_revoked = is_revoked
        self._trouble = trouble
        self.now = now

    def check(self, identity: Identity) -> None:
        """Raise LinkExpired, LinkRevoked or StateUnavailable if the link of `identity` is no longer good."""
        self.check_link(identity.token_id, identity.expires)
        self.check_list()

    def check_link(self, token_id: str, expires: float) -> None:
        """Check a link by what is known of it, even while revocations are unknown."""
        if not expires > self.now():  # also when it is not a number
            raise LinkExpired("this link has expired; ask for a new one")
        if self._is_revoked(token_id):
            raise LinkRevoked("this link was revoked")

    def check_list(self) -> None:
        """Raise StateUnavailable while it is unknown which links are revoked."""
        if trouble := self._trouble():
            raise StateUnavailable(f"the console admits no one: it cannot read the list of revoked links: {trouble}")


class Access:
    """Issues and checks tokens. A sender of a token that the console did not sign is never told what is wrong with it.

    Args:
        is_revoked: True for the id of a revoked token
        trouble: the reason while it is unknown which links are revoked, else ""
        now: s since 1970
        robot: the robot to check access to: only links that are good for it pass, and tickets made for another robot
            are refused; "": the only robot of a console, None: the fleet itself, to which every good link gives access
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
        self._links = LinkCheck(is_revoked, trouble, now)
        self._signer = TokenSigner(secret)
        self._token_seconds = token_seconds
        self._ticket_seconds = ticket_seconds

    def at(self, robot: str | None) -> Self:
        """Return the same access control for another robot."""
        other = copy(self)
        other._robot = robot
        return other

    def issue(self, role: Role, name: str, robots: tuple[str, ...] = ()) -> str:
        """Return a token with a new id, good for as long as the settings say."""
        now = self._links.now()
        return self.sign(Identity(role, name, secrets.token_hex(8), now + self._token_seconds, robots), now)

    def sign(self, identity: Identity, issued: float) -> str:
        """Return the token of `identity`; the same arguments give the same token."""
        role, name, token_id, expires, robots = identity[:5]
        return self._signer.encode(LinkClaims("lockstep", expires, issued, role, name, token_id, robots))

    def verify(self, token: str) -> Identity:
        """Return the holder of `token`.

        Raises:
            TokenInvalid: not a token of this console.
            LinkExpired, LinkRevoked: it is no longer good.
            LinkOtherRobot: it is good for other robots.
            StateUnavailable: it is unknown whether it is revoked.
        """
        identity = self._identity(token)
        self._links.check(identity)
        return identity

    def bearer(self, authorization: str | None) -> Right:
        """Return the right that an Authorization header (RFC 6750 2.1) gives.

        Raises:
            TokenMissing: there is no bearer token.
            AccessError, StateUnavailable: as `verify`.
        """
        right = Right(self._identity(_required_token(authorization)), self._links.check)
        right.identity  # noqa: B018  raises
        return right

    def bearer_to_stop(self, authorization: str | None) -> Right:
        """Return the right as `bearer` does, even while revocations are unknown: a stop must not wait for a disk."""
        right = Right(
            self._identity(_required_token(authorization)),
            lambda identity: self._links.check_link(identity.token_id, identity.expires),
        )
        right.identity  # noqa: B018  raises
        return right

    def issue_ticket(self, holder: Identity) -> str:
        """Issue a short-lived ticket for the 3D scene to the holder of a link. It ends no later than the link.

        It may stand in a path: it opens nothing else.
        """
        return self._signer.encode(TicketClaims("lockstep-scene", *self._ticket_for(holder), self._own))

    def verify_ticket(self, ticket: str) -> SceneTicket:
        """Return the link that a ticket was made for; raise as `verify` does."""
        claims = self._signer.decode(ticket, TicketClaims)
        self._check_ticket(claims)
        return SceneTicket(claims.link, claims.role, claims.ends)

    def issue_file_ticket(self, file: str, holder: Identity) -> str:
        """Issue a short-lived ticket for one recording's download to the holder of a link."""
        return self._signer.encode(FileClaims("lockstep-file", *self._ticket_for(holder), file, self._own))

    def verify_file_ticket(self, ticket: str, file: str) -> Right:
        """Return the right of a ticket's link; raise as `verify` does, also if the ticket is for another file."""
        claims = self._signer.decode(ticket, FileClaims)
        self._check_ticket(claims)
        if claims.file != file:
            raise TokenInvalid(INVALID)
        return Right(Identity(claims.role, claims.name, claims.link, claims.ends), self._links.check)

    def _identity(self, token: str) -> Identity:
        claims = self._signer.decode(token, LinkClaims)
        self._links.check_link(claims.jti, claims.exp)
        identity = Identity(claims.role, claims.name, claims.jti, claims.exp, claims.robots, claims.iat)
        if self._robot is not None and not identity.may_see(self._robot):
            raise LinkOtherRobot("this link does not admit to this robot")
        return identity

    def _ticket_for(self, holder: Identity) -> tuple[float, float, Role, str, str]:
        expires = min(self._links.now() + self._ticket_seconds, holder.expires)
        return expires, holder.expires, holder.role, holder.name, holder.token_id

    def _check_ticket(self, claims: TicketClaims | FileClaims) -> None:
        self._links.check_link(claims.link, min(claims.exp, claims.ends))
        self._links.check_list()
        if claims.robot != self._own:
            raise TokenInvalid(INVALID)

    @property
    def _own(self) -> str:
        return self._robot or ""


def bearer_token(authorization: str | None) -> str:
    """Return the token in an Authorization header (RFC 6750 2.1), or ""."""
    scheme, _, token = (authorization or "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else ""


def _required_token(authorization: str | None) -> str:
    token = bearer_token(authorization)
    if not token:
        raise TokenMissing("send the token as: Authorization: Bearer TOKEN")
    return token


def require_role(caller: HasRole, *roles: Role) -> None:
    """Raise NotAllowed unless `caller` has one of `roles`."""
    if caller.role not in roles:
        raise NotAllowed(f"only the {' or the '.join(roles)} may do this")
