"""Tasks: rules for arrays of all worlds, or for one world at a time.

batch_task      BatchTask: a task on arrays of all worlds; Agent: one animal of every world
task            Task: a task of one world at a time, in plain Python
task_settings   settings of both kinds of tasks
user_tasks      preparation of user tasks: as arrays of worlds, or with evolved eyes
per_world       PerWorld: a Task, or several, as a BatchTask
encounter       Encounter: several tasks in one world; Frozen
registry        the built-in tasks by name
built_in        common parts of the built-in tasks: the sliding agent, its senses and its reward
find_goal       detection, foraging and tracking
find_way        navigation and maze
simulation      Simulation: worlds of a task, without rendering
command         Command: the meaning of a number in an action
outcome         Outcome of an action, Step
batch_arrays    checks of arrays that tasks return
reward          the built-in reward's named terms and their weights
placement       random starting positions of agents and objects
reach           times at which an agent reaches objects
object_motion   motion of the objects in tracking
random_streams  random streams of worlds, by two schemes
eye_kinds       kinds of eyes of one animal
task_fidelity   choice of the fidelity of eyes in a task
"""
