"""The samples under the microscope: drops of soft gel on a glass slide. Geometry and stiffness only.

A drop is a paraboloid that the glass cuts off: height h (1 - r² / a²). All in metres, x forward, y left, z up from the
glass.
"""

from typing import Final, NamedTuple

__all__ = ["GLASS_STIFFNESS", "MICRO", "SAMPLES", "Sample", "Touch", "touches"]

MICRO: Final = 1e-6
GLASS_STIFFNESS: Final = 20_000.0  # N/m, a thousand times the needle's

Vector = tuple[float, float, float]


class Sample(NamedTuple):
    """A drop of gel."""

    name: str
    x: float
    y: float
    radius: float  # m, at the glass
    height: float
    modulus: float  # Pa, reduced: E / (1 - ν²)
    rgb: tuple[float, float, float]  # 0 to 1

    def depth(self, x: float, y: float, z: float) -> tuple[float, Vector]:
        """Return the depth of a point under the surface (m, negative above it), and the outward normal there."""
        dx, dy, square = x - self.x, y - self.y, self.radius * self.radius
        slope = 2.0 * self.height / square
        nx, ny = slope * dx, slope * dy
        length = (nx * nx + ny * ny + 1.0) ** 0.5
        surface = self.height * (1.0 - (dx * dx + dy * dy) / square)
        return (surface - z) / length, (nx / length, ny / length, 1.0 / length)


class Touch(NamedTuple):
    """A touch of the tip: its depth (m), the outward normal, and the sample (None: the glass)."""

    depth: float
    normal: Vector
    sample: Sample | None


SAMPLES: Final = (
    Sample("soft", 38 * MICRO, 42 * MICRO, 36 * MICRO, 15 * MICRO, 0.06e6, (0.86, 0.45, 0.52)),
    Sample("medium", 30 * MICRO, -58 * MICRO, 30 * MICRO, 13 * MICRO, 0.35e6, (0.46, 0.70, 0.48)),
    Sample("firm", -34 * MICRO, 78 * MICRO, 24 * MICRO, 11 * MICRO, 1.6e6, (0.40, 0.56, 0.82)),
    Sample("small", 76 * MICRO, -8 * MICRO, 15 * MICRO, 8 * MICRO, 0.12e6, (0.84, 0.60, 0.38)),
    Sample("flat", -52 * MICRO, -18 * MICRO, 27 * MICRO, 6 * MICRO, 0.20e6, (0.66, 0.50, 0.74)),
    Sample("far", -10 * MICRO, -118 * MICRO, 21 * MICRO, 10 * MICRO, 0.80e6, (0.42, 0.66, 0.68)),
)


def touches(x: float, y: float, z: float, radius: float) -> list[Touch]:
    """Return all touches of a ball of `radius` (m) with its lowest point at (x, y, z)."""
    found = []
    if z < 0.0:
        found.append(Touch(-z, (0.0, 0.0, 1.0), None))
    for sample in SAMPLES:
        reach = sample.radius + radius
        if z > sample.height or abs(x - sample.x) > reach or abs(y - sample.y) > reach:
            continue
        depth, normal = sample.depth(x, y, z + radius)
        if depth + radius > 0.0:
            found.append(Touch(depth + radius, normal, sample))
    return found
