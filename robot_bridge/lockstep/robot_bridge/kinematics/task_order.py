"""Tasks of joints in an order of priority: each in the null space of those before it, and damped by itself.

Sources: Nakamura and Hanafusa 1986 (damping near singularities), Chiaverini 1997 (the later task in the null space of
the earlier one, each damped by itself), Sugihara 2011 (damping by the error).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Damping", "TaskOrder", "task_order"]

Array = npt.NDArray[np.float64]


class Damping(NamedTuple):
    """Of directions that are nearly singular."""

    small: float  # singular values below this are damped
    most: float  # at a singular value of zero


GAPS: Final = Damping(small=0.05, most=0.02)  # of the lengths of their gradients, of gaps that bind together


class _Task(NamedTuple):
    jacobian: Array
    out: Array  # the left singular vectors, in rows
    into: Array  # the right ones in columns, as far as the joints are left to this task
    values: Array  # the singular values
    damped: Array  # their squares, with the damping that depends on them

    def rates(self, speed: Array, before: Array, residual: float) -> Array:
        """Return what the joints add to the rates `before`. `residual`: further damping."""
        missing = self.out @ (speed - self.jacobian @ before)
        rates: Array = self.into @ (self.values / (self.damped + residual) * missing)
        return rates


class TaskOrder(NamedTuple):
    """Made by `task_order`."""

    free: Array  # of each joint
    gaps: _Task | None  # that bind
    most: Array  # m/s per length of their gradients, at which the gaps become wider
    tasks: tuple[_Task, ...]
    left: Array  # joints x joints: what is left after all tasks

    def rates(self, speeds: Sequence[Array], residuals: Sequence[float], held: Array, pull: Array | None) -> Array:
        """Return the rates of the free joints; the gaps that bind become narrower as fast as they may.

        `speeds`: m/s or rad/s, of each task. `residuals`: further damping of each. `held`: the rates of the joints that
        are not free. `pull`: rates for what is left.
        """
        rates = np.zeros(len(held)) if self.gaps is None else self.gaps.rates(self.most, held, 0.0)
        for task, speed, residual in zip(self.tasks, speeds, residuals, strict=True):
            rates = rates + task.rates(speed, rates + held, residual)
        if pull is not None:
            rates = rates + self.left @ pull
        return rates * self.free


def task_order(
    jacobians: Sequence[tuple[Array, Damping]], free: Array, gradients: Array, most: Array, steep: Array
) -> TaskOrder:
    """Return the order of tasks, the first first, for the joints that are free.

    `gradients`, `most`, `steep`: of the gaps that bind, see `GapLimits`; these come before all tasks.
    """
    left = np.diag(free.astype(float))
    gaps = None
    if len(gradients):
        gaps, basis = _task(gradients / steep[:, None], left, GAPS)
        left = left - basis @ basis.T
    tasks = []
    for jacobian, damping in jacobians:
        task, basis = _task(jacobian, left, damping)
        tasks.append(task)
        left = left - basis @ basis.T
    return TaskOrder(free.copy(), gaps, -most / steep, tuple(tasks), left)


def _task(jacobian: Array, left: Array, damping: Damping) -> tuple[_Task, Array]:
    """Return a task of the joints that are `left`, and a basis of those that it uses.

    A direction whose singular value is small counts for the basis by the share that the damping leaves of it, so that
    what is left for later tasks changes without a jump.
    """
    out, values, right = np.linalg.svd(jacobian @ left, full_matrices=False)
    squares = values * values
    near = np.minimum(np.maximum(1.0 - squares / damping.small**2, 0.0), 1.0)
    damped = squares + damping.most**2 * near + 1e-12
    return _Task(jacobian, out.T, left @ right.T, values, damped), right.T * np.sqrt(squares / damped)
