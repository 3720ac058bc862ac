"""Recordings: MCAP files of a session in which everything carries its event reference (docs/recording.md)."""
