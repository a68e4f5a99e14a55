"""Times and rates on this machine.

batch_task_throughput  one task for one world at a time and on arrays of all
two_checkouts          whole steps here and in another checkout
steps_per_second       steps per CPU second of worlds and models; a proof, with bounds on ratios
sim_throughput         renderer and environment against MuJoCo's renderer
learning_throughput    training with PPO against MuJoCo's renderer
area_times             eyes by rays and by areas
edge_times             rays at edges alone against as many everywhere
kernel_times           kernels of evolving eyes
many_zones             foci of many Fresnel zones
first_psf              the first PSF of a process
fit_costs              operations against the numbers that predict their time
picture_times          a quick picture of an agent against a slow one
gpu                    processor and GPU
"""
