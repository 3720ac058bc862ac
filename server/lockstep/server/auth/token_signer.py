"""The claims of the console's tokens, and their signature (JWT, HS256, RFC 7519)."""

from typing import Annotated, Any, Literal, TypeVar

import jwt
import msgspec

from lockstep.protocol.console import Role
from lockstep.server.errors import TokenInvalid

__all__ = ["INVALID", "MAX_ROBOTS", "FileClaims", "LinkClaims", "RobotName", "TicketClaims", "TokenSigner"]

ALGORITHM = "HS256"
MAX_TOKEN = 4096  # characters; the console's have about 200, and 40 more for each robot that they name
MAX_ROBOTS = 32  # robots that one link may name
INVALID = "the token is not valid"

RobotName = Annotated[str, msgspec.Meta(max_length=32)]


class LinkClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep"]
    exp: float
    iat: float
    role: Role
    name: Annotated[str, msgspec.Meta(max_length=60)]
    jti: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    robots: Annotated[tuple[RobotName, ...], msgspec.Meta(max_length=MAX_ROBOTS)] = ()


class TicketClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep-scene"]
    exp: float
    ends: float  # when the link it was made for ends
    role: Role  # of that link
    name: Annotated[str, msgspec.Meta(max_length=60)]
    link: Annotated[str, msgspec.Meta(max_length=64)]  # id of that link
    robot: RobotName = ""  # the one whose scene it opens


class FileClaims(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    aud: Literal["lockstep-file"]
    exp: float
    ends: float
    role: Role
    name: Annotated[str, msgspec.Meta(max_length=60)]
    link: Annotated[str, msgspec.Meta(max_length=64)]
    file: Annotated[str, msgspec.Meta(max_length=200)]  # the one recording that it opens
    robot: RobotName = ""  # the one whose recording it is


Claims = TypeVar("Claims", LinkClaims, TicketClaims, FileClaims)

_decoders: dict[type, msgspec.json.Decoder[Any]] = {
    kind: msgspec.json.Decoder(kind) for kind in (LinkClaims, TicketClaims, FileClaims)
}


class TokenSigner:
    """Makes and reads tokens with one secret. It knows nothing of their being good."""

    def __init__(self, secret: str) -> None:
        self._secret = secret

    def encode(self, claims: LinkClaims | TicketClaims | FileClaims) -> str:
        return jwt.encode(msgspec.to_builtins(claims), self._secret, ALGORITHM)

    def decode(self, token: str, kind: type[Claims]) -> Claims:
        """Decode the claims strictly: exactly these, of these types. PyJWT only checks the signature.

        Raises:
            TokenInvalid: not a token of this kind with this signature.
        """
        try:
            if len(token) > MAX_TOKEN:
                raise TokenInvalid(INVALID)
            payload = jwt.api_jws.decode(token, self._secret, algorithms=[ALGORITHM])
            claims: Claims = _decoders[kind].decode(payload)
            return claims
        except (jwt.InvalidTokenError, msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise TokenInvalid(INVALID) from error
