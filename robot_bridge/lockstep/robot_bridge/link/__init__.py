"""The robot link: connections, sessions, and their bounds (docs/robot-link.md)."""
