"""Access tokens of LiveKit (https://docs.livekit.io/frontends/authentication/tokens/): JWTs with a `video` grant.

LiveKit looks at them when somebody comes in, and gives those who are in new ones by itself. So they are good for a
minute only.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jwt

__all__ = ["GOOD_SECONDS", "LiveKitKeys"]

GOOD_SECONDS = 60.0  # to come in
CLOCK_SECONDS = 10.0  # that LiveKit's clock may be behind ours


@dataclass(frozen=True, repr=False)
class LiveKitKeys:
    """What a LiveKit server knows of this console. Never logged, never handed out."""

    key: str  # its name
    secret: str

    def publisher_token(self, room: str, identity: str, now: float) -> str:
        """For the console: it makes the room, sends, and takes nothing. `now` is in s since 1970."""
        grant = {"roomCreate": True, "canPublish": True, "canPublishData": True, "canSubscribe": False}
        return self._token(room, identity, now, grant)

    def observer_token(self, room: str, identity: str, now: float) -> str:
        """For one observer: it takes and sends nothing, and the others do not hear of it."""
        grant = {"canPublish": False, "canPublishData": False, "canSubscribe": True, "hidden": True}
        return self._token(room, identity, now, {**grant, "canUpdateOwnMetadata": False})

    def _token(self, room: str, identity: str, now: float, grant: Mapping[str, bool]) -> str:
        claims = {
            "iss": self.key,
            "sub": identity,
            "nbf": int(now - CLOCK_SECONDS),
            "exp": int(now + GOOD_SECONDS),
            "video": {"room": room, "roomJoin": True, **grant},
        }
        return jwt.encode(claims, self.secret, algorithm="HS256")
