"""The needle: a cantilever whose tip rests where its bending balances the contact. Quasi-static, no clock.

Soft samples push back by Hertz' law for a blunt tip: F = 4/3 E* √R δ^1.5, along the surface's normal. The surface also
sticks to the tip and is dragged along, until friction gives way.
"""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

from lockstep.robot_bridge.robots.micromanipulator.samples import GLASS_STIFFNESS, Sample, Touch, touches

__all__ = ["STIFFNESS", "TIP_RADIUS", "Contact", "Needle"]

TIP_RADIUS: Final = 4e-6  # m
STIFFNESS: Final = (14.0, 14.0, 20.0)  # N/m of the tip against the holder, along x, y, z
FRICTION: Final = 0.5
STICKING: Final = 4.0  # N/m, of a surface that sticks to the tip; well below the needle's, so that stepping is stable
ROUNDS: Final = 6  # of Newton's method at most
CLOSE: Final = 1e-10  # m, change at which the method has converged

Vector = tuple[float, float, float]


class Contact(NamedTuple):
    """The contact of the tip, for pictures and sound."""

    sample: Sample | None  # the sample in which the tip is deepest; None: only the glass
    depth: float  # m, indentation along the normal
    drag: tuple[float, float]  # m, drag of the surface along x and y


class Needle:
    """Call `move` with the holder's place, then read the tip's place and force.

    Attributes:
        tip: m, lowest point of the tip
        bend: m, from the place where the tip would be without a force
        force: N, on the needle, along x, y, z
        contact: None if nothing is touched
    """

    def __init__(self, holder: Vector) -> None:
        self.tip = holder
        self.bend: Vector = (0.0, 0.0, 0.0)
        self.force: Vector = (0.0, 0.0, 0.0)
        self.contact: Contact | None = None
        self._drag = (0.0, 0.0)

    def move(self, holder: Vector) -> None:
        """Move the holder to the place where the tip would be if the needle were straight."""
        if self.contact is None and not touches(*holder, TIP_RADIUS):
            self.tip = holder
            return
        before = self.tip
        self._settle(holder)
        found = touches(*self.tip, TIP_RADIUS)
        if not found:
            self.tip = holder
            self.bend = self.force = (0.0, 0.0, 0.0)
            self.contact, self._drag = None, (0.0, 0.0)
            return
        pressure = sum(_push(each)[0] for each in found)
        self._stick(before, pressure)
        stiffness = zip(STIFFNESS, self.bend, strict=True)
        self.force = _vector(each * bend for each, bend in stiffness)
        deepest = max((each for each in found), key=lambda each: (each.sample is not None, each.depth))
        self.contact = Contact(deepest.sample, deepest.depth, self._drag)

    def _settle(self, holder: Vector) -> None:
        """Find the bending at which all forces on the tip add up to zero, by Newton's method."""
        bend = self.bend
        for _ in range(ROUNDS):
            x, y, z = (place + by for place, by in zip(holder, bend, strict=True))
            matrix = [[STIFFNESS[0], 0.0, 0.0], [0.0, STIFFNESS[1], 0.0], [0.0, 0.0, STIFFNESS[2]]]
            left = [
                -STIFFNESS[0] * bend[0] - STICKING * self._drag[0],
                -STIFFNESS[1] * bend[1],
                -STIFFNESS[2] * bend[2],
            ]
            left[1] -= STICKING * self._drag[1]
            for touch in touches(x, y, z, TIP_RADIUS):
                push, stiffness = _push(touch)
                for row, across in enumerate(touch.normal):
                    left[row] += push * across
                    for column, along in enumerate(touch.normal):
                        matrix[row][column] += stiffness * across * along
            change = _solved(matrix, left)
            bend = _vector(by + more for by, more in zip(bend, change, strict=True))
            if max(map(abs, change)) < CLOSE:
                break
        self.bend = bend
        self.tip = _vector(place + by for place, by in zip(holder, bend, strict=True))

    def _stick(self, before: Vector, pressure: float) -> None:
        """Drag the surface by the tip's way along it, as far as friction holds."""
        drag_x, drag_y = self._drag[0] + self.tip[0] - before[0], self._drag[1] + self.tip[1] - before[1]
        most, dragged = FRICTION * pressure / STICKING, math.hypot(drag_x, drag_y)
        if dragged > most:
            drag_x, drag_y = drag_x * most / dragged, drag_y * most / dragged
        self._drag = (drag_x, drag_y)


def _push(touch: Touch) -> tuple[float, float]:
    """Return force (N) and stiffness (N/m) along the normal."""
    if touch.sample is None:
        return GLASS_STIFFNESS * touch.depth, GLASS_STIFFNESS
    root = math.sqrt(TIP_RADIUS * touch.depth)
    return 4.0 / 3.0 * touch.sample.modulus * root * touch.depth, 2.0 * touch.sample.modulus * root


def _solved(matrix: list[list[float]], right: list[float]) -> Vector:
    """Solve for three unknowns by Cramer's rule. The needle's own stiffness keeps the matrix from being singular."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    u, v, w = right
    first, second, third = e * i - f * h, f * g - d * i, d * h - e * g
    size = a * first + b * second + c * third
    return (
        (u * first + v * (c * h - b * i) + w * (b * f - c * e)) / size,
        (u * second + v * (a * i - c * g) + w * (c * d - a * f)) / size,
        (u * third + v * (b * g - a * h) + w * (a * e - b * d)) / size,
    )


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = values
    return (x, y, z)
