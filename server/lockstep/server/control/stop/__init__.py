"""Decides who may stop and reset the robot, and passes presses of STOP and resets on."""
