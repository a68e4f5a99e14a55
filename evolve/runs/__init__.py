"""Starting and resuming runs: the code that the command `evolve` and Python's `evolve.run` and `evolve.resume` share.

begin       from settings to a run directory; bad settings are refused before anything is written
resume      an interrupted run: locked, repaired, checked and made ready to go on
carry_on    executor and watchers, and the search between them
start_from  starting from an animal of another run
progress    how a run is going: watchers for terminals, logs and machines
output      text for a terminal, made safe to print
"""
