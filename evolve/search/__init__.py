"""The search over generations.

ask_tell            the search in its simplest form, as an introduction
loop                main loop: proposals, evaluations, record and optimizer
search              Search: proposals, phases and seeds
optimizers          CMA-ES and other optimizers
null_model          search with random fitness
same_search         check that a search repeats the candidates on record
successive_halving  selection of the candidates that continue after a rung
job                 jobs for executors
local_executor      executor with processes on this machine
worker              worker process of the local executor
dask_executor       executor on a Dask cluster
scheduler           address and certificates of a Dask scheduler
dask_worker         evaluation of a candidate in a Dask worker
"""
