"""Cameras of robots that MuJoCo simulates: OpenGL in a separate thread. Importing this imports no MuJoCo."""
