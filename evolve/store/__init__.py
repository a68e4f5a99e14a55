"""The run directory: it stores, and decides nothing.

directory     Run
record        Record: candidates.jsonl, read, checked, added to
candidate     Candidate: one line of the record
evaluation    Evaluation: what became of a candidate
shipped_run   copy_shipped_run: the run that comes with rhabdom
policies      whether they are those of the record
lock          one process at a time
regular_files the one door to a run's files: no links, no FIFOs
atomic_files  files that are written whole or not at all
versions      with which software a run was made
"""
