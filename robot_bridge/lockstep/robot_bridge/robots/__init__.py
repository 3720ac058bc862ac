"""Robots that the bridge can run: one folder or file each, behind `lockstep.robot_bridge.robots.base.Robot`."""
