"""Resolves a twist of the tool into velocities of the arm's joints, also near singularities and joint limits."""

import contextlib
import math
from collections.abc import Sequence
from operator import truediv
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Resolution", "ResolvedRates"]

Array = npt.NDArray[np.float64]

LENGTH: Final = 0.25  # m, weighs rotation against translation: 1 rad/s counts as much as 0.25 m/s
SCALE: Final = np.array((1.0, 1.0, 1.0, LENGTH, LENGTH, LENGTH))
SMALL: Final = 0.06  # m, singular values below this are damped
DAMPING: Final = 0.05  # m, at a singular value of zero
LIMIT_ZONE: Final = 0.20  # rad before a joint limit in which the joint is used less and less
PASSES: Final = 3  # a joint that is held back makes others do more, which may come into their limits in turn
LOST: Final = 0.35  # share of the wanted twist that may be missing before it is reported


class Resolution(NamedTuple):
    velocities: tuple[float, ...]  # rad/s of each joint
    limited: tuple[int, ...]  # joints held back by their limits
    lost: bool  # the arm cannot make a good part of the twist here


class ResolvedRates:
    """Solves by damped least squares, with weights that fade out a joint that runs into its limit."""

    def __init__(self, lower: Sequence[float], upper: Sequence[float], fastest: Sequence[float]) -> None:
        self._lower = tuple(lower)  # rad
        self._upper = tuple(upper)  # rad
        self._fastest = tuple(fastest)  # rad/s

    def resolve(self, jacobian: Array, twist: Array, joints: Sequence[float]) -> Resolution:
        """Return the joint velocities that move the tool by `twist` (m/s, rad/s), as nearly as the arm can."""
        scaled_jacobian = jacobian * SCALE[:, None]
        scaled_twist = twist * SCALE
        weights = [1.0] * len(joints)
        velocities = damped_inverse(scaled_jacobian, scaled_twist)
        freedom = self._freedom(joints, velocities)
        for _ in range(PASSES):
            allowed = list(map(min, weights, freedom))
            if allowed == weights:
                break
            weights = allowed
            shares = np.array(weights)
            velocities = shares * damped_inverse(scaled_jacobian * shares, scaled_twist)
            freedom = self._freedom(joints, velocities)
        if min(freedom) <= 0.0:
            velocities = np.where(np.array(freedom) > 0.0, velocities, 0.0)
        missing = math.hypot(*(scaled_jacobian @ velocities - scaled_twist).tolist())
        slower = max(1.0, *map(truediv, np.abs(velocities).tolist(), self._fastest))  # same direction
        return Resolution(
            tuple((velocities / slower).tolist()),
            tuple(index for index, weight in enumerate(weights) if weight < 0.5),
            missing > LOST * math.hypot(*scaled_twist.tolist()),
        )

    def _freedom(self, places: Sequence[float], velocities: Array) -> list[float]:
        """Return 1 for a joint that may move on, falling to 0 at the limit that it moves to."""
        freedom = []
        for place, velocity, lower, upper in zip(places, velocities.tolist(), self._lower, self._upper, strict=True):
            room = upper - place if velocity > 0.0 else place - lower
            freedom.append(1.0 if velocity == 0.0 else min(max(room / LIMIT_ZONE, 0.0), 1.0))
        return freedom


def damped_inverse(jacobian: Array, twist: Array) -> Array:
    """Solve by least squares, damping only the directions that are nearly singular, so that others stay exact."""
    with contextlib.suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(jacobian)
        if np.vdot(inverse, inverse) <= SMALL**-2:  # the sum of 1 / value² over all singular values: none is small
            return inverse @ twist
    left, values, right = np.linalg.svd(jacobian)
    damping = DAMPING**2 * np.clip(1.0 - (values / SMALL) ** 2, 0.0, 1.0)
    return right.T @ ((left.T @ twist) * values / (values**2 + damping))  # type: ignore[no-any-return]
