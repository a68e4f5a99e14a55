"""Tests of evolve/analysis: which test covers which module.

statistics: test_statistics.py, test_genealogy.py
white_light: test_white_light.py
fitness_parts: report/test_priced_report.py
acuity: test_statistics.py, report/test_priced_report.py
vision: test_vision.py
episode_failures: test_episode_failures.py
genealogy: test_genealogy.py
held_out: learning/test_final_figures.py
recorder: test_recorder.py, test_episode.py
held_out: learning/test_final_figures.py
episode: test_episode.py, test_recorder.py
episode_scene: report/test_rerun_bodies.py
episode_file: test_episode.py, config/test_formats.py
"""
