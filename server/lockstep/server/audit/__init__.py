"""The audit: who drove, stopped and let in whom, on disk and in memory."""
