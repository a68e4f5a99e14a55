"""Tests of tasks: which test covers which module.

reward: test_reward.py, test_task.py, envs/test_tasks_page.py
placement: test_task.py
object_motion: test_task.py
random_streams: envs/test_vec_env.py
eye_kinds: envs/test_eye_kinds.py
task: envs/test_task_vec_env.py, envs/test_encounter.py
encounter: envs/test_encounter.py, envs/test_bad_encounters.py
batch_task: envs/test_batch_task.py, envs/test_features.py
task_settings: envs/test_task_vec_env.py, envs/test_eye_kinds.py
per_world: envs/test_task_vec_env.py, envs/test_broken_worlds.py, envs/test_encounter.py, envs/test_own_models.py
registry: test_task.py
built_in: test_task.py
find_goal: test_task.py
find_way: test_task.py, worlds/test_course.py
simulation: test_task.py, envs/test_features.py
command: evolve/report/test_player.py
outcome: test_task.py, envs/test_task_vec_env.py
batch_arrays: envs/test_batch_task.py
reach: test_task.py
task_fidelity: render/test_model_fidelity.py, envs/test_encounter.py
user_tasks: envs/test_eye_kinds.py, envs/test_batch_task.py, evolve/learning/test_task_module.py
"""
