"""Where the command `lockstep` begins."""

import gc

__all__ = ["main"]


def main() -> None:
    """Run it. Looking for garbage among what is being imported would take a sixth of the start, and find none."""
    gc.disable()
    from server.cli import main as run

    gc.enable()
    run()
