"""Tests of evolve/config: which test covers which module.

run_config: test_run_config.py
eye_checks: test_run_config.py
layout_checks: learning/test_final_figures.py
settings: test_assemble.py, test_run_config.py, test_parameters.py
costs: test_costs.py
assemble: test_assemble.py, test_presets.py
sources: test_sources.py, test_assemble.py
provenance: test_provenance.py
checks: test_assemble.py, test_provenance.py
lint: test_lint.py
layout_checks: learning/test_final_figures.py, test_run_config.py
relief_starts: test_relief_starts.py
formats: test_formats.py
square_eyes: test_square_eyes.py
task_choice: test_task_choice.py
task_card: test_task_choice.py, test_run_config.py, test_lint.py
task_code: test_task_choice.py
task_errors: learning/test_hostile_tasks.py
numbering: test_numbering.py
"""
