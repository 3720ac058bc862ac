"""The console's WebRTC endpoint and its addresses."""
