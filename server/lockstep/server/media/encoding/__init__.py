"""Encoding of pictures and sound in worker threads, and who gets which encoding."""
