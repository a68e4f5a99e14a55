"""The run directory: storage of a run's settings and results, without any logic of the search.

directory     Run: a run directory with its config, record and other files
record        Record: the file candidates.jsonl, with one line for each evaluation of a candidate
candidate     Candidate: one line of the record
evaluation    Evaluation: outcome of a candidate's training and evaluation
shipped_run   copy_shipped_run: the run that ships with rhabdom
chain         Chain: checksums of the lines of a record
checksums     checksums of whole files
policies      checks that the policy files match the record
lock          lock of a run, which only one process at a time can hold
regular_files access to a run's files; links and FIFOs are refused
atomic_files  files that are written completely or not at all
versions      versions of the software at each start of a run
"""
