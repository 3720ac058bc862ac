"""The gaps of an arm that are narrow, looked for only where they may be: far from everything an arm moves freely.

A gap changes by no more than the joints move times their levers. So what was so wide at some joint positions that no
motion since can have made it narrow is not computed again (as in conservative advancement, Mirtich 1996).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import ChainState
from lockstep.robot_bridge.kinematics.clearance import Gap, GapSource

__all__ = ["NearGaps"]

Array = npt.NDArray[np.float64]
FURTHER: Final = 0.1  # m beyond what is narrow, up to which distances are looked up
AGAIN: Final = 0.02  # m that one must have changed by at most, before they are looked up again


class NearGaps:
    """Returns what asking every source each time would return, but for gaps that no joint changes."""

    def __init__(self, sources: Sequence[GapSource]) -> None:
        self._sources = tuple(sources)
        levers = np.concatenate([source.levers for source in sources]) if sources else np.zeros((0, 0))
        self._change = levers.any(axis=1)  # of each distance: joints change it
        self._levers = levers[self._change]
        self._bounded = bool(np.isfinite(self._levers).all())
        self._seen: Array | None = None  # rad, joint positions at which the distances were looked up
        self._within = 0.0  # m, what was narrow then
        self._spare = np.zeros(len(self._levers))  # m, from there to each distance
        self._narrowest = 0  # number of that distance

    def gaps(self, joints: Array, state: ChainState, within: float, ahead: Array | None = None) -> list[Gap]:
        """Return the gaps that are narrower than `within` (m), or become so by the motion `ahead` of the joints.

        `joints`: rad or m, at which the chain has this state.
        """
        if not len(self._levers):
            return []
        if self._bounded and self._are_wide(joints, state, within, ahead):
            return []
        return [gap for source in self._sources for gap in source.gaps(state, within, ahead)]

    def _are_wide(self, joints: Array, state: ChainState, within: float, ahead: Array | None) -> bool:
        """Return whether no distance can be narrow, by what it was and how far the joints are from there."""
        motion = None if ahead is None else np.abs(ahead)
        if self._seen is not None and within == self._within:
            moved = np.abs(joints - self._seen)
            if self._is_narrow_still(moved, motion):
                return False
            change = self._levers @ moved
            if (change + self._soon(motion) < self._spare).all():
                return True
            if change.max() < AGAIN:
                return False
        self._seen, self._within = joints.copy(), within
        widths = np.concatenate([source.widths(state, within + FURTHER) for source in self._sources])
        self._spare = widths[self._change] - within
        self._narrowest = int(self._spare.argmin())
        return bool((self._soon(motion) < self._spare).all())

    def _soon(self, motion: Array | None) -> Array | float:
        """Return by how much each distance may become narrower by a motion ahead, m."""
        return 0.0 if motion is None else self._levers @ motion

    def _is_narrow_still(self, moved: Array, motion: Array | None) -> bool:
        """Return whether the narrowest distance cannot have become wide. The usual case close by, so it is quick."""
        levers = self._levers[self._narrowest]
        soon = 0.0 if motion is None else levers @ motion
        return bool(self._spare[self._narrowest] + levers @ moved <= soon)
