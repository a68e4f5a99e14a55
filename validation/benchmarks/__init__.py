"""Times and rates on this machine.

batch_task_throughput  a task on single worlds and on arrays of all worlds
two_checkouts          whole steps in this checkout and in another
steps_per_second       steps per CPU second of worlds and models (a proof with bounds on ratios)
sim_throughput         renderer and environment compared with MuJoCo's renderer
learning_throughput    training with PPO compared with MuJoCo's renderer
area_times             ray sampling and area sampling of eyes
compound_eye_times     compound eyes compared with the same eyes made of mounts
edge_times             adaptive edge sampling compared with uniform sampling
kernel_times           kernels of evolving eyes
many_zones             foci of many Fresnel zones
first_psf              the first PSF of a process
fit_costs              operations compared with the constants that predict their time
picture_times          fast and slow renderings of an agent
gpu                    processor and GPU
"""
