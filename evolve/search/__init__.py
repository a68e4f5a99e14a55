"""The search over generations.

ask_tell            the whole idea in a page: read this first
loop                propose, evaluate, write down, tell
search              Search: proposals, phases, seeds
optimizers          CMA-ES and others
null_model          the same search with random fitness
same_search         whether a search proposes what is on record
successive_halving  who is trained further
job                 what executors are given
local_executor      processes on this machine
worker              what such a process does
dask_executor       many machines
scheduler           where they are asked for, and by which certificates
dask_worker         what one of them does
"""
