"""The session live to Foxglove, Lichtblick and other viewers that speak Foxglove's WebSocket protocol."""
