"""Faults in each phase of an episode, by name."""

from collections.abc import Awaitable, Callable, Mapping
from typing import Final

from lockstep.bench.episodes.faults.console_faults import kill_countdown, kill_keeping, kill_open, kill_reset
from lockstep.bench.episodes.faults.dataset_faults import LOW_BYTES, discard_late, fill_disk, kill_export
from lockstep.bench.episodes.faults.fault_run import ALONE, RESET, FaultName, FaultRun
from lockstep.bench.episodes.faults.policy_fault import kill_policy
from lockstep.bench.episodes.faults.robot_faults import camera_hangs, kill_robot, kill_robot_keeping, kill_robot_reset

__all__ = ["meet", "settings_of"]

LONG_COUNTDOWN: Final = "4"


async def meet(run: FaultRun) -> None:
    """Let the run meet its fault, and note what the console says of it."""
    await _FAULTS[run.fault](run)


def settings_of(fault: FaultName | None) -> dict[str, str]:
    """Return the settings of a console that can meet the fault, LOCKSTEP_…; None: that meets none."""
    return {
        "LOCKSTEP_RECORDING__AUTOMATIC": "true",
        "LOCKSTEP_RECORDING__FREE_BYTES": str(LOW_BYTES if fault == "disk-low" else 0),
        "LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": LONG_COUNTDOWN if fault == "kill-countdown" else "0",
        "LOCKSTEP_EPISODES__RESET_ACTION": RESET if fault in ALONE else "",
    }


_FAULTS: Final[Mapping[FaultName, Callable[[FaultRun], Awaitable[None]]]] = {
    "kill-countdown": kill_countdown,
    "kill-open": kill_open,
    "kill-keeping": kill_keeping,
    "kill-reset": kill_reset,
    "kill-robot": kill_robot,
    "kill-robot-keeping": kill_robot_keeping,
    "kill-robot-reset": kill_robot_reset,
    "kill-policy": kill_policy,
    "kill-export": kill_export,
    "discard-late": discard_late,
    "disk-low": fill_disk,
    "disk-full": fill_disk,
    "camera-hangs": camera_hangs,
}
