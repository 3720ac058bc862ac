"""Access tokens: signed (JWT, HS256, RFC 7519), with a role and a name."""

import secrets
import time
from typing import NamedTuple

import jwt

from robot_bridge.protocol.console import Role
from server.errors import NotAllowed, TokenInvalid, TokenMissing

__all__ = ["Access", "Identity", "require_role"]

ALGORITHM = "HS256"
AUDIENCE = "lockstep"
SCENE_AUDIENCE = "lockstep-scene"
MAX_TOKEN = 2048  # characters; ours have about 200


class Identity(NamedTuple):
    """Who a token stands for."""

    role: Role
    name: str
    token_id: str


class Access:
    """Issues and checks tokens. A refused token is never told why: all refusals are the same."""

    def __init__(self, secret: str, token_seconds: float, ticket_seconds: float) -> None:
        self._secret = secret
        self._token_seconds = token_seconds
        self._ticket_seconds = ticket_seconds

    def issue(self, role: Role, name: str) -> str:
        return self._sign({"role": role, "name": name, "jti": secrets.token_hex(8)}, AUDIENCE, self._token_seconds)

    def verify(self, token: str) -> Identity:
        """Whom `token` stands for.

        Raises:
            TokenInvalid: not a token of this console, or expired.
        """
        claims = self._claims(token, AUDIENCE, ["role", "name", "jti"])
        role, name, token_id = claims["role"], claims["name"], claims["jti"]
        if (role != "operator" and role != "observer") or not isinstance(name, str) or not isinstance(token_id, str):
            raise TokenInvalid("the token is not valid")
        return Identity(role, name[:60], token_id)

    def bearer(self, authorization: str | None) -> Identity:
        """Whom an Authorization header stands for (RFC 6750 2.1).

        Raises:
            TokenMissing: there is no bearer token.
            TokenInvalid: the token is not valid.
        """
        scheme, _, token = (authorization or "").partition(" ")
        if scheme.lower() != "bearer" or not token.strip():
            raise TokenMissing("send the token as: Authorization: Bearer TOKEN")
        return self.verify(token.strip())

    def issue_ticket(self) -> str:
        """A short-lived permission to watch the 3D scene. It may stand in a path: it opens nothing else."""
        return self._sign({}, SCENE_AUDIENCE, self._ticket_seconds)

    def verify_ticket(self, ticket: str) -> None:
        """Raises TokenInvalid as `verify` does."""
        self._claims(ticket, SCENE_AUDIENCE, [])

    def _sign(self, claims: dict[str, str], audience: str, seconds: float) -> str:
        return jwt.encode({**claims, "aud": audience, "exp": time.time() + seconds}, self._secret, ALGORITHM)

    def _claims(self, token: str, audience: str, required: list[str]) -> dict[str, object]:
        try:
            if len(token) > MAX_TOKEN:
                raise TokenInvalid("the token is not valid")
            claims: dict[str, object] = jwt.decode(
                token,
                self._secret,
                algorithms=[ALGORITHM],
                audience=audience,
                options={"require": ["exp", "aud", *required]},
            )
        except (jwt.InvalidTokenError, UnicodeError, RecursionError) as error:
            raise TokenInvalid("the token is not valid") from error
        return claims


def require_role(identity: Identity, role: Role) -> None:
    """Raises NotAllowed unless `identity` has `role`."""
    if identity.role != role:
        raise NotAllowed(f"only the {role} may do this")
