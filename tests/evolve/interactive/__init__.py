"""Tests of evolve/interactive: which test covers which module.

run_from_python: test_run_from_python.py
opened_run: test_opened_run.py, test_run_from_python.py, test_run_products.py, learning/test_animals_in_turn.py
callbacks: test_run_from_python.py
table: test_opened_run.py
eye_picture: test_opened_run.py
summary: test_opened_run.py
"""
