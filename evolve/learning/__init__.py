"""Training run and evaluation of one animal.

fitness           evaluate: training run and fitness of a candidate
animal_task       task with an animal in it
training_envs     environments for training, selection and test
task_module       execution of a user task's code
task_trial        short trial of a user task before a run
ppo               PPO with early stopping
policy            actor and critic, with storage
observed          entries of an observation other than the eyes' signals
eye_features      encoder of each eye
per_eye_layers    linear layers with separate weights per eye
schedule          decrease of step size and passes during training
training_rewards  rewards in the learner's units, with reduced costs at the start
rollout_buffer    rollout buffer that stores each frame once
adam              optimiser
tensor_file       tensors from a run's files
checkpoint        state of a training run, stored in a file
training_rung     rung of a training run
"""
