"""Tasks: the rules of environments, written for arrays of all worlds or for one world at a time.

batch_task      BatchTask: a task on arrays of all worlds; Agent: an animal that exists once in every world
task            Task: a task of one world at a time, in plain Python
task_settings   settings of both kinds of tasks
user_tasks      preparation of user tasks: conversion to a BatchTask, and replacement of the eyes by evolved ones
per_world       PerWorld: a BatchTask that calls the methods of one or several Tasks world by world
encounter       Encounter: several animals in one world; Frozen: an animal with a fixed policy
registry        the built-in tasks by name
built_in        common parts of the built-in tasks: the sliding agent, its senses and its reward
find_goal       detection, foraging and tracking
find_way        navigation and maze
simulation      Simulation: worlds of a task, without rendering
command         Command: the meaning of a number in an action
outcome         Outcome: result of one action, which a task returns; Step: one action of all worlds
batch_arrays    checks of arrays that tasks return
reward          the built-in reward's named terms and their weights
placement       random starting positions of agents and objects
reach           times at which an agent reaches objects
object_motion   motion of the objects in tracking
random_streams  random number generators of the worlds, in two schemes
eye_kinds       kinds of eyes of one animal
task_fidelity   choice of the rendering fidelity of the eyes in a task
"""
