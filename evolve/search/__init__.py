"""The search over generations.

ask_tell            minimal example of a search, as an introduction
loop                main loop of a run, from proposals to recorded candidates
search              Search: proposals of candidates and their seeds; genes may begin to vary in later generations
optimizers          CMA-ES and other optimizers
null_model          searches with random fitness, for comparison with runs
same_search         check that a search, rebuilt to continue a run, proposes the recorded candidates
successive_halving  selection of the candidates that continue after a rung (a part of training)
job                 Job: a candidate for an executor to evaluate
local_executor      executor with processes on this machine
worker              worker process of the local executor
dask_executor       executor on a Dask cluster
dask_connection     connection to a Dask scheduler, with a limited waiting time
signs_of_life       time since the last signs of life of a Dask scheduler and its workers
scheduler           address and certificates of a Dask scheduler
dask_worker         evaluation of a candidate in a Dask worker
"""
