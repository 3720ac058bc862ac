"""Contact: Hertz on gel, the bending needle, friction."""

import math

import pytest

from lockstep.robot_bridge.robots.micromanipulator.needle import FRICTION, STIFFNESS, TIP_RADIUS, Needle
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES, Sample

SOFT, _, FIRM = SAMPLES[:3]
ABOVE = 50 * MICRO


def lowered(sample: Sample, by: float, steps: int = 200) -> Needle:
    """The holder goes straight down on the top of a drop, to `by` below its top."""
    needle = Needle((sample.x, sample.y, ABOVE))
    for step in range(steps + 1):
        needle.move((sample.x, sample.y, ABOVE + (sample.height - by - ABOVE) * step / steps))
    return needle


def test_in_the_air_nothing_is_felt_and_the_needle_is_straight() -> None:
    needle = lowered(SOFT, -1 * MICRO)
    assert needle.force == (0.0, 0.0, 0.0)
    assert needle.bend == (0.0, 0.0, 0.0)
    assert needle.contact is None


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
@pytest.mark.parametrize("by", [1 * MICRO, 3 * MICRO, 5 * MICRO])
def test_a_drop_pushes_back_as_hertz_has_it(sample: Sample, by: float) -> None:
    needle = lowered(sample, by)
    assert needle.contact is not None
    assert needle.contact.sample is sample
    depth = needle.contact.depth
    expected = 4 / 3 * sample.modulus * math.sqrt(TIP_RADIUS) * depth**1.5
    assert needle.force[2] == pytest.approx(expected, rel=0.01)
    assert depth + needle.bend[2] == pytest.approx(by, rel=0.01)  # what does not dent bends
    assert needle.force[2] == pytest.approx(STIFFNESS[2] * needle.bend[2], rel=1e-6)


def test_the_firmer_the_drop_the_larger_the_force_and_the_smaller_the_dent() -> None:
    soft, firm = lowered(SOFT, 5 * MICRO), lowered(FIRM, 5 * MICRO)
    assert firm.force[2] > 5 * soft.force[2]
    assert soft.contact is not None
    assert firm.contact is not None
    assert firm.contact.depth < soft.contact.depth


def test_forces_are_between_micronewtons_and_a_millinewton() -> None:
    assert 0.5e-6 < lowered(SOFT, 4 * MICRO).force[2] < 20e-6
    glass = Needle((0.0, 0.0, ABOVE))
    glass.move((0.0, 0.0, -16 * MICRO))
    assert 200e-6 < glass.force[2] < 1e-3


def test_glass_does_not_give_way() -> None:
    needle = Needle((0.0, 0.0, ABOVE))
    for step in range(100):
        needle.move((0.0, 0.0, -step / 10 * MICRO))
    assert needle.contact is not None
    assert needle.contact.sample is None
    assert abs(needle.tip[2]) < 0.05 * MICRO


def test_a_sideways_push_drags_the_surface_bends_the_needle_and_is_felt_against_the_motion() -> None:
    needle = lowered(FIRM, 4 * MICRO)
    before = needle.force
    for step in range(1, 101):
        needle.move((FIRM.x + step / 100 * 6 * MICRO, FIRM.y, FIRM.height - 4 * MICRO))
    assert needle.contact is not None
    assert needle.contact.drag[0] > 0.2 * MICRO
    assert needle.force[0] < before[0]
    assert needle.bend[0] < 0


def test_friction_gives_way_at_its_limit() -> None:
    needle = lowered(SOFT, 4 * MICRO)
    for step in range(1, 400):
        needle.move((SOFT.x, SOFT.y + step / 400 * 25 * MICRO, SOFT.height - 4 * MICRO))
        if needle.contact is not None:
            pressure = 4 / 3 * SOFT.modulus * math.sqrt(TIP_RADIUS) * needle.contact.depth**1.5
            assert math.hypot(*needle.contact.drag) * 4.0 <= FRICTION * pressure * 1.01


def test_pulled_back_it_lets_go_and_is_straight_again() -> None:
    needle = lowered(FIRM, 5 * MICRO)
    needle.move((FIRM.x, FIRM.y, ABOVE))
    assert needle.contact is None
    assert needle.tip == (FIRM.x, FIRM.y, ABOVE)
    assert needle.force == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("steps", [5, 50, 2000])
def test_how_fast_it_is_lowered_does_not_matter(steps: int) -> None:
    assert lowered(FIRM, 5 * MICRO, steps).force[2] == pytest.approx(lowered(FIRM, 5 * MICRO).force[2], rel=0.02)
