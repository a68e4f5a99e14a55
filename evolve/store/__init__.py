"""The run directory, which stores results and contains no logic of the search.

directory     Run: a run directory
record        Record: the file candidates.jsonl
candidate     Candidate: one line of the record
evaluation    Evaluation: outcome of a candidate's training and evaluation
shipped_run   copy_shipped_run: the run that ships with rhabdom
policies      comparison of policy files with the record
lock          lock that admits one process at a time
regular_files access to a run's files, which refuses links and FIFOs
atomic_files  files that are written completely or not at all
versions      versions of the software of a run
"""
