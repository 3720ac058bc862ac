"""The console service: signalling, seat, media, scene."""
