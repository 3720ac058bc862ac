import numpy as np
import numpy.typing as npt
import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.resolved_rates import ResolvedRates

Array = npt.NDArray[np.float64]
JOINTS = 6


def rates() -> ResolvedRates:
    return ResolvedRates([-2.0] * JOINTS, [2.0] * JOINTS, [1.5] * JOINTS)


def well_conditioned() -> Array:
    return np.eye(JOINTS) * 0.5 + 0.02 * np.arange(36).reshape(6, 6) / 36


def test_away_from_limits_and_singularities_the_twist_is_made_exactly() -> None:
    jacobian, twist = well_conditioned(), np.array((0.1, -0.05, 0.02, 0.1, 0.0, -0.1))
    resolution = rates().resolve(jacobian, twist, [0.0] * JOINTS)
    assert jacobian @ resolution.velocities == pytest.approx(twist, abs=1e-9)
    assert resolution.limited == ()
    assert not resolution.lost


def test_a_twist_too_fast_is_made_slower_in_the_same_direction() -> None:
    jacobian, twist = well_conditioned(), np.array((5.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    resolution = rates().resolve(jacobian, twist, [0.0] * JOINTS)
    made = jacobian @ resolution.velocities
    assert np.abs(resolution.velocities).max() == pytest.approx(1.5)
    assert made / np.linalg.norm(made) == pytest.approx(twist / np.linalg.norm(twist), abs=1e-9)


@pytest.mark.parametrize("smallest", [0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.05])
def test_near_a_singularity_the_velocities_stay_bounded_and_finite(smallest: float) -> None:
    jacobian = np.diag((0.5, 0.5, smallest, 2.0, 2.0, 2.0))
    resolution = rates().resolve(jacobian, np.array((0.1, 0.0, 0.1, 0.0, 0.0, 0.0)), [0.0] * JOINTS)
    assert np.isfinite(resolution.velocities).all()
    assert np.abs(resolution.velocities).max() <= 1.5
    assert jacobian[0] @ resolution.velocities > 0.05  # the direction that can be made still is


def test_a_twist_that_cannot_be_made_is_reported() -> None:
    jacobian = np.diag((0.5, 0.5, 0.0, 2.0, 2.0, 2.0))
    assert rates().resolve(jacobian, np.array((0.0, 0.0, 0.1, 0.0, 0.0, 0.0)), [0.0] * JOINTS).lost


def test_a_joint_at_its_limit_does_not_move_on_but_may_move_back() -> None:
    joints = (2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    twist = np.array((0.1, 0.1, 0.0, 0.0, 0.0, 0.0))
    outwards = rates().resolve(np.eye(JOINTS) * 0.5, twist, joints)
    assert outwards.velocities[0] == 0.0
    assert outwards.velocities[1] == pytest.approx(0.2)
    assert outwards.limited == (0,)
    inwards = rates().resolve(np.eye(JOINTS) * 0.5, -twist, joints)
    assert inwards.velocities[0] == pytest.approx(-0.2)
    assert inwards.limited == ()


def test_a_joint_beyond_its_limit_does_not_move_farther() -> None:
    joints = (0.0, -2.1, 0.0, 0.0, 0.0, 0.0)
    resolution = rates().resolve(np.eye(JOINTS), np.array((0.0, -0.1, 0.0, 0.0, 0.0, 0.0)), joints)
    assert resolution.velocities[1] == 0.0
