"""What a command gate knows of the sound of one microphone, and whether events wait for it. No I/O.

Checked by tests/vectors/pacing.json. The page has the same rule in web/src/drive/awaited_sound.ts.
"""

from typing import Final, NamedTuple

from lockstep.protocol.serial import event_gap

__all__ = ["AwaitedSound", "hear", "most_behind"]

HOLE: Final = 0.200  # s; no segment lasts longer, and sound that pauses is waited for no longer
PAUSES_FOR: Final = 10.0  # s
FAR_FOR: Final = 3.0  # s of sound that was too far behind, after which nothing waits for it: its path is too slow


class AwaitedSound(NamedTuple):
    """The sound of one microphone."""

    stamp: int  # of the newest segment
    at: float  # s, when that began to play, or was too old to
    event: int  # newest feedback then
    far: float  # s for which sound came that was too far behind, since the last that was not
    pauses_until: float  # s; silence that begins before is taken for a pause

    def silent_at(self, awaited: float) -> float:
        """Return the time from which nothing waits for it, unless another segment plays before.

        `awaited`: s for which sound that fell silent is waited for, unless it pauses.
        """
        return self.at + (min(HOLE, awaited) if self.at < self.pauses_until else awaited)

    def is_awaited(self, awaited: float, now: float) -> bool:
        """Return whether events wait for it. None waits for sound that was too far behind for 3 s, pauses or not."""
        return self.far <= FAR_FOR and now < self.silent_at(awaited)


def most_behind(tolerance: int) -> int:
    """Return how far behind the feedback sound may be, so that the next event does not take it out of tolerance."""
    return max(tolerance - 1, 0)


def hear(before: AwaitedSound | None, stamp: int, event: int, most_gap: int, now: float) -> AwaitedSound:
    """Return what is known once a segment plays, or is too old to.

    `before`: what was known of its microphone. `event`: newest feedback. `most_gap`: events; sound that is farther
    behind the feedback is too far behind.
    """
    is_far = event_gap(event, stamp) > most_gap
    if before is None:
        return AwaitedSound(stamp, now, event, 0.0, float("-inf"))
    hole = now - before.at
    paused = hole > HOLE and _was_pause(before, stamp, event)
    return AwaitedSound(
        stamp,
        now,
        event,
        before.far + min(hole, HOLE) if is_far else 0.0,
        now + PAUSES_FOR if paused else before.pauses_until,
    )


def _was_pause(before: AwaitedSound, stamp: int, event: int) -> bool:
    """Late sound goes on where it stopped. After a pause it is no farther behind than before, whatever has passed."""
    return event_gap(event, before.event) > 2 and event_gap(event, stamp) <= event_gap(before.event, before.stamp)
