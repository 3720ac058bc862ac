"""The audit of drivers, stops and invitations, on disk and in memory."""
