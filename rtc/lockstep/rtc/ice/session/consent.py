"""Consent to send on a path (RFC 7675): the times of its checks and of its end."""

from random import Random

from lockstep.rtc.ice.settings import IceSettings

__all__ = ["Consent"]


class Consent:
    """The consent on one path. A check is sent every 4 to 6 s and never repeated; consent expires 30 s after the last
    sign of the peer's will.

    Such a sign is a valid answer to any check of the last 30 s, however late it comes, or an authenticated check of the
    peer that was not seen before. The second goes beyond RFC 7675 5.1: where answers are lost and checks are not, the
    peer still shows that it wants to hear.
    """

    def __init__(self, given_at: float, now: float, settings: IceSettings, rng: Random) -> None:
        """`given_at` is the time of the last answer on the path, at most `now`."""
        self._given_at = given_at
        self._settings = settings
        self._rng = rng
        self.next_check_at = now
        self.checked(now)

    @property
    def expires_at(self) -> float:
        return self._given_at + self._settings.consent_seconds

    def checked(self, now: float) -> None:
        """Note that a check was sent."""
        self.next_check_at = now + self._rng.uniform(*self._settings.consent_interval)

    def given(self, now: float) -> None:
        """Note that the peer has answered, or has checked."""
        self._given_at = max(self._given_at, now)
