"""Robots that only measurements drive."""
