"""Runs from Python and in notebooks: the same code and the same record as the command's.

run_from_python  evolve.run and evolve.resume: a run to its end
opened_run       evolve.Run: a run to look at, and to resume
callbacks        a user's functions as a watcher
table            candidates as a table
eye_picture      an animal's eyes, drawn
summary          what a notebook shows of a run and of an animal
"""
