"""The cases of `lockstep check`, one file for each part of docs/robot-link.md."""
