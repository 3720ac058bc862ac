"""The wishes of shadow policies, in the 3D scene."""
