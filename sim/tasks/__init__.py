"""Tasks: rules for arrays of all worlds, or for one world at a time.

batch_task      BatchTask: a task on arrays of all worlds; Agent: who acts in it
task            Task: a task of one world at a time, in plain Python
task_settings   settings that both have
user_tasks      tasks that users write: for arrays, with eyes that evolve
per_world       PerWorld: a Task, or several, as a BatchTask
encounter       Encounter: several tasks in one world; Frozen
registry        the built-in tasks by name
built_in        what these share: the sliding agent, its senses and its reward
find_goal       detection, foraging and tracking
find_way        navigation and maze
simulation      Simulation: worlds of a task in motion, unseen
command         Command: the meaning of a number in an action
outcome         Outcome of an action, Step
batch_arrays    arrays that tasks return, checked
reward          the built-in reward's named terms and their weights
placement       where episodes start
reach           when an agent reaches an object
object_motion   how the objects of tracking move
random_streams  random streams of worlds, by two schemes
eye_kinds       kinds of eyes of one animal
task_fidelity   how finely eyes in a task see
"""
