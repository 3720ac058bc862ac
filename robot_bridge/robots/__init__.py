"""Robots that the bridge can run: one folder or file each, behind `robot_bridge.robots.base.Robot`."""
