"""Emulates a network between two namespaces of the kernel, for programs that know nothing of it."""
