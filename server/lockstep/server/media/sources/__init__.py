"""Cameras and microphones attached to the console itself: read in processes of their own, stamped here."""
