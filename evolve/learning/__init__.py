"""Training run and evaluation of one animal.

fitness           evaluate: training run and fitness of a candidate
final_figures     results of a trained policy in episodes that neither training nor selection has used
animal_task       a run's task with one animal in it
training_envs     environments for training, selection and fitness
task_module       execution of the code of a user task
task_trial        short trial of a user task before a run
played_episodes   episodes that a policy plays without exploration
ppo               PPO training, which stops early if returns no longer improve
policy            policy of an animal (actor and critic), and its storage in files
distribution      normal distribution of a policy's actions
observed          entries of an observation other than the eyes' signals
eye_features      encoder of each eye
per_eye_layers    linear layers for each eye, with its own or with shared weights
hexagonal_layers  convolution over the ommatidia of a compound eye
regridding        averaging and repetition of signals before the encoder
schedule          decrease of Adam's step size and of the passes over the samples during training
training_rewards  scaling of rewards for the learner, with lower costs at the start
rollout_buffer    rollout buffer that stores each frame once
adam              Adam optimizer on a single vector of all weights
tensor_file       reading of tensors from a run's files
checkpoint        state of a training run, stored in a file
checkpoint_file   owner and checksum of such a file
training_rung     rung of a training run under successive halving
"""
