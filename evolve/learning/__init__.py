"""One lifetime: an animal learns its task.

fitness           evaluate: a candidate's whole life
animal_task       the task with an animal in it
worlds            where an animal lives
task_module       a task of somebody's own, executed
task_trial        the same, tried for a moment
ppo               PPO, its settings' meaning, early stopping
policy            actor and critic, stored and loaded
observed          entries of an observation beside the eyes
eye_features      the network behind each eye
per_eye_layers    what it is made of
schedule          how it slows down: step size and passes
training_rewards  rewards in the learner's units, some terms at a share of their price
rollout_buffer    frames kept once
adam              the optimiser
tensor_file       tensors from a run's files
checkpoint        a training as it stands
training_stage    how far a training goes
"""
