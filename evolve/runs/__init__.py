"""Starting and resuming runs, for the command `evolve` and for Python's `evolve.run` and `evolve.resume`.

begin       creation of a run directory from settings, which are checked before anything is written
resume      preparation of an interrupted run: lock, repair and checks
carry_on    search with an executor and watchers
start_from  start values from an animal of another run
progress    watchers that show a run's progress on terminals, in logs and as JSON
output      safe output of text on a terminal
"""
