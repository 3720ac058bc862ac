"""Where the console keeps what has to outlive it: keys, its certificate, revocations, the audit."""

import os
from collections.abc import Mapping
from pathlib import Path

__all__ = ["default_state_dir"]


def default_state_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """$XDG_STATE_HOME/lockstep (XDG Base Directory 0.8), which is ~/.local/state/lockstep unless that is set."""
    base = environment.get("XDG_STATE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".local" / "state") / "lockstep"
