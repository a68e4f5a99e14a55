"""Proofs of worlds, renderers and environments, and what they need.

scene_against_mujoco      mirrored models against MuJoCo's own renderer
receptive_field_sampling  receptive fields sampled by rays against a convolution
eyes_against_ray_caster   eyes on models against MuJoCo's ray caster
speed_accuracy            error against speed of every way to render signals
equal_brightness          goal and adversary are equally bright to one receptor
environment_endurance     memory and kernels of an environment over many steps

scenes                    worlds, eyes and states that proofs share
mujoco_pictures           geom ids and depth by MuJoCo's renderer, in a process of its own
speed_accuracy_points     points, front and table of speed_accuracy
speed_accuracy_figure     its figure
"""
