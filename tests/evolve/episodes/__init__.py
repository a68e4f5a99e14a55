"""Tests of evolve/episodes: which test covers which module.

held_out: learning/test_final_figures.py
tracks: test_tracks.py
recorder: test_recorder.py, test_episode.py
episode: test_episode.py, test_recorder.py
episode_scene: report/test_rerun_bodies.py
episode_file: test_episode.py, config/test_formats.py
"""
