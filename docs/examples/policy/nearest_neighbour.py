"""A policy that follows demonstrations: it does what was done in the most alike moment. It needs numpy alone."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.reading.event_rows import event_rows
from lockstep.server.recording.reading.reader import RecordingReader

Array = npt.NDArray[np.float64]

BEHIND, AHEAD = 3, 12  # moments of the same demonstration in which it looks first
ORDER: Final = 1e-5  # rad² for each moment² away from the next one: where nothing moves, time goes on
LOST: Final = 0.15  # rad: further from its moment than this, it looks everywhere anew
STEP: Final = 0.35  # rad, of an arm's joint from where it is measured: half of what the robot takes in one command


class Demonstration(NamedTuple):
    """One kept episode: in the state of a row its action was commanded."""

    states: Array  # (n, 2 x joints), rad: measured, and where they were commanded to be
    actions: Array  # (n, joints), rad; the last one is the gripper


def state_of(feedback: Feedback, joints: int) -> Array:
    """Return the state that the policy knows, rad. The goals tell a gripper that grips from one that is shut."""
    measured = feedback.axes[:joints]
    goals = [there if goal is None else goal for goal, there in zip(feedback.goals[:joints], measured, strict=True)]
    return np.array([*measured, *goals])


def read_demonstrations(path: Path, joints: int) -> list[Demonstration]:
    """Read the kept, successful episodes of a recording; the joints are the robot's first axes.

    Of an episode in which a policy drove, only what followed the first correction is read; without one, nothing.

    Raises:
        RecordingError, OSError: it cannot be read.
    """
    found = []
    with RecordingReader(path) as reader:
        rows = list(event_rows(reader))
        for episode in reader.index.episodes:
            if episode.state != "kept" or episode.outcome != "success":
                continue
            of_it = [row for row in rows if episode.first_event < row.feedback.event <= episode.last_event]
            with_policy = any(row.driven_by.kind == "policy" for row in of_it)
            begins = [row.feedback.event for row in of_it if row.driven_by.intervention or not with_policy]
            first = min(begins, default=episode.last_event)
            states, actions = [], []
            for before, after in zip(rows, rows[1:], strict=False):
                if not first <= after.feedback.event <= episode.last_event or after.command is None:
                    continue
                action = after.command.values[:joints]
                if None not in action:  # else some joint was to stay: nobody drove
                    states.append(state_of(before.feedback, joints))
                    actions.append(action)
            found.append(Demonstration(np.array(states), np.array(actions, dtype=np.float64)))
    return [each for each in found if len(each.states)]


class NearestNeighbour:
    """Call `action` with each feedback.

    Attributes:
        progress: share of the demonstration that it follows, 0 to 1
    """

    def __init__(self, demonstrations: Sequence[Demonstration]) -> None:
        """Raises ValueError without a demonstration."""
        if not demonstrations:
            raise ValueError("there is nothing to learn from: no episode was kept as a success")
        self.demonstrations = list(demonstrations)
        self._joints = demonstrations[0].actions.shape[1]
        self._which, self._at = -1, 0  # the demonstration and its moment; -1: lost
        self.progress = 0.0

    def begin(self) -> None:
        """Look for the most alike moment everywhere, as after a correction."""
        self._which = -1

    def action(self, feedback: Feedback) -> list[float]:
        """Return where each joint is to be, rad."""
        state = state_of(feedback, self._joints)
        if self._which < 0 or self._distances(self._which, state)[self._at] > LOST**2:
            self._look_everywhere(state)
        else:
            self._look_nearby(state)
        demonstration = self.demonstrations[self._which]
        self.progress = (self._at + 1) / len(demonstration.states)
        there = demonstration.actions[self._at]
        near = np.clip(there, state[: self._joints] - STEP, state[: self._joints] + STEP)
        return [*near[:-1].tolist(), float(there[-1])]  # a block keeps the fingers from their goal, which is the grip

    def _distances(self, which: int, state: Array) -> Array:
        """Return for each moment the square of the largest difference of a joint."""
        largest: Array = np.abs(self.demonstrations[which].states - state).max(axis=1) ** 2
        return largest

    def _look_everywhere(self, state: Array) -> None:
        nearest = [self._distances(which, state).min() for which in range(len(self.demonstrations))]
        self._which = int(np.argmin(nearest))
        self._at = int(self._distances(self._which, state).argmin())

    def _look_nearby(self, state: Array) -> None:
        distances = self._distances(self._which, state)
        moments = np.arange(max(0, self._at - BEHIND), min(len(distances), self._at + 1 + AHEAD))
        costs = distances[moments] + ORDER * (moments - (self._at + 1)) ** 2
        self._at = int(moments[costs.argmin()])
