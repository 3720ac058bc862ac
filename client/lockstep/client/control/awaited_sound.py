"""What a command gate knows of the sound of one microphone, and whether events wait for it. No I/O.

Checked by tests/vectors/pacing.json. The page has the same rule in web/src/drive/awaited_sound.ts.
"""

from typing import Final, Literal, NamedTuple

from lockstep.protocol.serial import event_gap

__all__ = ["AwaitedSound", "Pacing", "hear"]

Pacing = Literal["feedback", "media"]

# Sound that fell silent is waited for so long: what is late may still come. With feedback pacing each wait is short;
# with media pacing the next command waits until then, and the robot must not come to rest.
AWAITED: Final = {"feedback": 0.600, "media": 0.200}  # s
HOLE: Final = 0.200  # s; no segment lasts longer. Sound that pauses is waited for no longer either
PAUSES_FOR: Final = 10.0  # s
TOO_OLD_FOR: Final = 3.0  # s of sound that was always too old, after which nothing waits for it: its path is too slow


class AwaitedSound(NamedTuple):
    """The sound of one microphone."""

    stamp: int  # of the newest segment
    at: float  # s, when it played, or was too old to
    event: int  # newest feedback then
    too_old_since: float | None  # s; None: it is not
    pauses_until: float  # s; silence that begins before is taken for a pause

    def silent_at(self, pacing: Pacing) -> float:
        """Return the time from which nothing waits for it, unless another segment plays before."""
        return self.at + (HOLE if self.at < self.pauses_until else AWAITED[pacing])

    def is_awaited(self, pacing: Pacing, now: float) -> bool:
        """Return whether events wait for it."""
        if self.too_old_since is not None and now - self.too_old_since > TOO_OLD_FOR:
            return False
        return now < self.silent_at(pacing)


def hear(before: AwaitedSound | None, stamp: int, event: int, tolerance: int, now: float) -> AwaitedSound:
    """Return what is known once a segment plays, or is too old to. `before`: what was known of its microphone."""
    hole = float("inf") if before is None else now - before.at
    since = None if before is None or hole > AWAITED["feedback"] else before.too_old_since
    pauses_until = float("-inf") if before is None else before.pauses_until
    if before is not None and hole > HOLE and _was_pause(before, stamp, event):
        pauses_until = now + PAUSES_FOR
    is_too_old = event_gap(event, stamp) > tolerance
    return AwaitedSound(stamp, now, event, (now if since is None else since) if is_too_old else None, pauses_until)


def _was_pause(before: AwaitedSound, stamp: int, event: int) -> bool:
    """Late sound goes on where it stopped. After a pause it is no farther behind than before, whatever has passed."""
    return event_gap(event, before.event) > 2 and event_gap(event, stamp) <= event_gap(before.event, before.stamp) + 1
