"""Cameras and microphones attached to the console itself: read in separate processes, stamped here."""
