"""Proofs of worlds, renderers and environments, and their helpers.

scene_against_mujoco      mirrored models compared with MuJoCo's renderer
receptive_field_sampling  ray sampling of receptive fields compared with a convolution
eyes_against_ray_caster   eyes on models compared with MuJoCo's ray caster
occlusion_against_thin_lens  occlusion at edges compared with Mitsuba's thin lens
speed_accuracy            error against speed of all rendering methods
automatic_choice          cost of the automatic choice of samples
equal_brightness          equal brightness of goal and adversary to one receptor
environment_endurance     memory and kernels of an environment over many steps

scenes                    shared worlds, eyes and states
mujoco_pictures           geom ids and depth by MuJoCo's renderer, in a separate process
speed_accuracy_points     points, front and table of speed_accuracy
speed_accuracy_figure     figure of speed_accuracy
"""
