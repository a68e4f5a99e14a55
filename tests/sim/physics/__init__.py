"""Tests of physics: which test covers which module.

free_motion: test_physics.py
local_contacts: test_local_contacts.py
mujoco_batch: test_local_contacts.py
controls: test_controls.py
agent_motion: test_physics.py
sliding_agents: tasks/test_task.py, envs/test_features.py
mujoco_worlds: envs/test_task_state.py, envs/test_broken_worlds.py, envs/test_own_models.py
array_worlds: envs/test_batch_task.py
varied_appearances: envs/test_features.py, envs/test_light_levels.py
physics: envs/test_features.py
"""
