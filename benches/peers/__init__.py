"""Pyramap beside what users would pick instead: the same frames, in turns, in one run.

`python -m peers` compares; `python -m peers.full_run` maps whole sequences with pyramap alone. See README.md.
"""
