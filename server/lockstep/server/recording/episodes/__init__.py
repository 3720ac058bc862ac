"""Episodes: stretches of a recording with a task and an outcome (docs/episodes.md)."""
