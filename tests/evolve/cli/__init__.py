"""Tests of evolve/cli: which test covers which module.

main: test_main.py
arguments: test_options.py, test_main.py
photograph_arguments: test_see.py, test_options.py
argument_values: store/test_sizes.py, report/test_gene_drift.py, interactive/test_run_products.py
waiting: test_products.py
notes: test_notes.py
run_plan: test_run_plan.py, test_dry_run.py
pace: test_pace.py, test_run_plan.py, test_dry_run.py
tensorboard: test_tensorboard.py
doctor: test_doctor.py
commands.run: test_commands.py, test_run_plan.py, search/test_kill.py, runs/test_two_faces.py
commands.status: test_main.py, test_status_and_compare.py, test_commands.py, test_hostile_runs.py, test_generations.py
commands.listings: test_main.py
commands.products: test_products.py, test_commands.py, test_main.py, interactive/test_run_products.py
commands.show_config: test_main.py
commands.demo: test_demo.py
commands.completion: test_main.py
commands.validate: test_validate.py
commands.compare: test_status_and_compare.py, test_generations.py
commands.see: test_see.py
commands.drift: report/test_gene_drift.py, test_generations.py
"""
