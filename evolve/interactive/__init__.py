"""Runs from Python and in notebooks, with the code and the record of the command `evolve`.

run_from_python  evolve.run and evolve.resume: complete runs
opened_run       evolve.Run: an opened run, for analysis and resumption
callbacks        a user's functions as a watcher
table            candidates as a table
eye_picture      figure of an animal's eyes
summary          display of runs and animals in notebooks
"""
