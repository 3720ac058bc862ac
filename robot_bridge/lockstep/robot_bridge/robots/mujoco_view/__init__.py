"""Cameras of robots that MuJoCo simulates: OpenGL in a thread of its own. Importing this imports no MuJoCo."""
