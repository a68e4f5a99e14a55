"""Runs from Python and in notebooks: the same engine and the same record as the command's.

begin        evolve.run: a run from its beginning to its end
opened_run   evolve.Run: a run to look at, and to carry on
carry_on     the engine, with callbacks
table        candidates as a table
eye_picture  an animal's eyes, drawn
summary      what a notebook shows of a run and of an animal
"""
