"""Start and analysis of runs from Python and in notebooks, with the same code and files as the command `evolve`.

run_from_python  evolve.run: start and complete a run; evolve.resume: complete an interrupted run
opened_run       evolve.Run: an opened run directory, to analyse or resume the run
callbacks        calls of a user's functions after each candidate
table            table of a run's candidates
eye_picture      figure of an animal's eyes
summary          display of runs and animals in notebooks
"""
