"""Tests of evolve/analysis: which test covers which module.

statistics: test_statistics.py, test_genealogy.py
white_light: test_white_light.py
fitness_parts: report/test_priced_report.py
acuity: test_statistics.py, report/test_priced_report.py
vision: test_vision.py
episode_failures: test_episode_failures.py
genealogy: test_genealogy.py
"""
