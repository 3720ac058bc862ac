"""From a twist of the tool to velocities of the arm's joints, near singularities and joint limits too. No physics."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Resolution", "ResolvedRates"]

Array = npt.NDArray[np.float64]

LENGTH: Final = 0.25  # m, weighs rotation against translation: 1 rad/s counts as much as 0.25 m/s
SMALL: Final = 0.06  # m, singular values below this are damped
DAMPING: Final = 0.05  # m, at a singular value of zero
LIMIT_ZONE: Final = 0.20  # rad before a joint limit in which the joint is used less and less
PASSES: Final = 3  # a joint that is held back makes others do more, which may come into their limits in turn
LOST: Final = 0.35  # share of the wanted twist that may be missing before it is reported


class Resolution(NamedTuple):
    velocities: Array  # rad/s of each joint
    limited: tuple[int, ...]  # joints held back by their limits
    lost: bool  # the arm cannot make a good part of the twist here


class ResolvedRates:
    """Damped least squares, with weights that fade out a joint that runs into its limit."""

    def __init__(self, lower: Array, upper: Array, fastest: Array) -> None:
        self._lower = lower  # rad
        self._upper = upper  # rad
        self._fastest = fastest  # rad/s

    def resolve(self, jacobian: Array, twist: Array, joints: Array) -> Resolution:
        """Joint velocities that move the tool by `twist` (m/s, rad/s), as nearly as the arm can."""
        scale = np.array((1.0, 1.0, 1.0, LENGTH, LENGTH, LENGTH))
        scaled_jacobian = jacobian * scale[:, None]
        scaled_twist = twist * scale
        weights = np.ones(len(joints))
        velocities = damped_inverse(scaled_jacobian, scaled_twist)
        for _ in range(PASSES):
            allowed = np.minimum(weights, self._freedom(joints, velocities))
            if np.array_equal(allowed, weights):
                break
            weights = allowed
            velocities = weights * damped_inverse(scaled_jacobian * weights, scaled_twist)
        velocities = np.where(self._freedom(joints, velocities) > 0.0, velocities, 0.0)
        missing = float(np.linalg.norm(scaled_jacobian @ velocities - scaled_twist))
        return Resolution(
            velocities / max(1.0, float(np.max(np.abs(velocities) / self._fastest))),  # slower, same direction
            tuple(int(index) for index in np.flatnonzero(weights < 0.5)),
            missing > LOST * float(np.linalg.norm(scaled_twist)),
        )

    def _freedom(self, joints: Array, velocities: Array) -> Array:
        """1 for a joint that may move on, falling to 0 at the limit that it moves to."""
        room = np.where(velocities > 0.0, self._upper - joints, joints - self._lower)
        freedom = np.clip(room / LIMIT_ZONE, 0.0, 1.0)
        return np.where(velocities == 0.0, 1.0, freedom)


def damped_inverse(jacobian: Array, twist: Array) -> Array:
    """Least squares where only the directions that are nearly singular are damped, so that others stay exact."""
    left, values, right = np.linalg.svd(jacobian)
    damping = DAMPING**2 * np.clip(1.0 - (values / SMALL) ** 2, 0.0, 1.0)
    return right.T @ ((left.T @ twist) * values / (values**2 + damping))  # type: ignore[no-any-return]
