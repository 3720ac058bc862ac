"""Runs `lockstep robot` as `python -m lockstep.robot_bridge`."""

from lockstep.robot_bridge.cli import main

main()
