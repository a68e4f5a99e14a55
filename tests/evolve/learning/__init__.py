"""Tests of evolve/learning: which test covers which module.

fitness: test_fitness.py
played_episodes: test_ppo.py, episodes/test_tracks.py
training_envs: test_fitness.py, test_task_module.py, test_animals_in_turn.py
task_module: test_task_module.py, test_textures_of_runs.py, test_animals_in_turn.py
task_trial: test_task_module.py, test_task_settings.py
ppo: test_ppo.py, test_learning.py, search/test_successive_halving.py
distribution: test_policy.py, test_adam.py
policy: test_policy.py
observed: test_policy.py, test_task_module.py
eye_features: test_eye_features.py, test_policy.py, test_learning.py
per_eye_layers: test_eye_features.py, test_policy.py, test_regridding.py
hexagonal_layers: test_hexagonal_layers.py
regridding: test_regridding.py
schedule: test_schedule.py, test_ppo.py
training_rewards: test_ppo.py
rollout_buffer: test_rollout_buffer.py
adam: test_adam.py
tensor_file: test_policy.py, store/test_regular_files.py
checkpoint: test_checkpoint.py, search/test_successive_halving.py
checkpoint_file: test_checkpoint.py, search/test_successive_halving.py
training_rung: search/test_successive_halving.py
animal_task: test_task_module.py, test_fitness.py, test_textures_of_runs.py
final_figures: test_final_figures.py, experiments/test_eyes_for_tasks.py
"""
