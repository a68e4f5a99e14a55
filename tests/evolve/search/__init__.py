"""Tests of evolve/search: which test covers which module.

ask_tell: test_ask_tell.py
loop: test_loop_parts.py, test_loop.py, test_ask_tell.py, test_kill.py, test_priced_search.py
search: test_search_parts.py, test_search.py
optimizers: test_search_parts.py, test_search.py, test_ask_tell.py
null_model: test_search_parts.py, test_null_model.py, test_priced_search.py
same_search: test_search_parts.py, test_same_search.py
successive_halving: test_rungs.py, test_successive_halving.py
job: test_local_executor.py, test_dask_executor.py
local_executor: test_worker_deaths.py, test_local_executor.py
worker: test_worker.py, test_local_executor.py
dask_executor: test_dask_rounds.py, test_dask_run.py, test_dask_executor.py, test_dask_connection.py
dask_connection: test_executor_parts.py, test_dask_connection.py, test_silent_cluster.py
signs_of_life: test_executor_parts.py, test_signs_of_life.py
scheduler: test_executor_parts.py, test_scheduler.py, test_dask_connection.py, test_dask_executor.py
dask_worker: test_dask_worker.py, test_dask_evaluation.py, test_dask_executor.py, learning/test_task_module.py
"""
