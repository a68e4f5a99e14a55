"""Tests of evolve/store: which test covers which module.

directory: test_directory.py, test_queries.py
record: test_record.py, test_chain.py, test_limits.py, test_queries.py, test_sizes.py
chain: test_chain.py
checksums: test_checksums.py, test_policies.py, test_queries.py
candidate: test_record.py, test_limits.py, test_queries.py, test_reads_back_equal.py, test_priced_record.py
evaluation: test_store_parts.py, test_limits.py, test_sizes.py, test_record.py, analysis/test_episode_failures.py
shipped_run: test_queries.py, cli/test_demo.py
policies: test_policies.py, test_queries.py
lock: test_store_parts.py, test_lock.py, test_limits.py, test_queries.py, test_regular_files.py
regular_files: test_store_parts.py, test_regular_files.py, test_limits.py, test_queries.py
atomic_files: test_atomic_files.py
versions: test_store_parts.py, test_versions.py, test_queries.py, interactive/test_run_products.py
"""
