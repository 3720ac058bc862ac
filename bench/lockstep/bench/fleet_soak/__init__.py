"""Several robots on one console, their bridges killed in turn: what do the others notice?"""
