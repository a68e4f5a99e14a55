"""Which test covers which module of evolve/analysis.

statistics: test_statistics.py, test_genealogy.py
vision: test_vision.py
mishaps: test_mishaps.py
genealogy: test_genealogy.py
recorder: test_recorder.py, test_episode.py
episode: test_episode.py, test_recorder.py
episode_scene: report/test_rerun_bodies.py
episode_file: test_episode.py, config/test_formats.py
"""
