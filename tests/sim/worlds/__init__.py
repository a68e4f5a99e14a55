"""Tests of worlds: which test covers which module.

catalog: test_catalog.py
world: test_world.py
detection: test_world.py, test_balance.py
foraging: test_foraging.py
course: test_course.py
random_course: test_layout_family.py
layout_family: test_layout_family.py
navigation: test_course.py
maze: test_world.py
random_course: test_layout_family.py
layout_family: test_layout_family.py
striped_walls: test_world.py, test_course.py
layout: test_world.py
materials: test_world.py
agent_model: physics/test_local_contacts.py
ground_plan: evolve/report/test_player.py, evolve/episodes/test_episode.py
state: envs/test_vec_env.py, physics/test_physics.py
"""
