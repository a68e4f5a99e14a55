"""What tests hold of tasks, module by module.

task: test_task.py
reward: test_reward.py, test_task.py, envs/test_tasks_page.py
placement: test_task.py
object_motion: test_task.py
random_streams: envs/test_vec_env.py
eye_kinds: envs/test_eye_kinds.py
user_task: envs/test_task_vec_env.py, envs/test_encounter.py
encounter: envs/test_encounter.py, envs/test_bad_encounters.py
"""
