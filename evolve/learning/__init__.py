"""One lifetime: an animal learns its task.

fitness         evaluate: a candidate's whole life
ppo             PPO, its settings' meaning, early stopping
policy          the network
rollout_buffer  frames kept once
adam            the optimiser
checkpoint      a training as it stands
training_stage  how far a training goes
"""
