"""Compresses a day of use into two hours, in as many runs as it takes."""
