"""Which test covers which module of evolve/analysis.

statistics: test_statistics.py, test_genealogy.py
vision: test_vision.py
mishaps: test_mishaps.py
genealogy: test_genealogy.py
episode: test_episode.py
filmed_episode: test_filmed_episode.py
filmed_scene: report/test_rerun_bodies.py
"""
