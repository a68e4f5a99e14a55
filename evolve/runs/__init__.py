"""Start and resumption of runs, for the command `evolve` and for the Python functions `evolve.run` and `evolve.resume`.

begin       creation of a run, after its settings have been checked
resume      preparation of an interrupted run for continuation: lock, repair and checks
carry_on    evaluation of all candidates that are missing in a run
start_from  start values of genes, taken from an animal of another run
progress    watchers that show a run's progress on terminals, in logs and as JSON
output      safe output of text on a terminal
"""
