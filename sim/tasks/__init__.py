"""What is asked of an agent.

task            what counts as progress, what ends an episode
reward          the reward's named terms and their weights
placement       where an episode starts
object_motion   how the objects of tracking move
random_streams  one random stream per world and purpose
user_task       Task: a task of a user's own model
encounter       Encounter: several tasks in one world; Frozen
eye_kinds       kinds of eyes of one animal
"""
