"""What a run's record and its animals say.

statistics      per generation; acuity, confidence
genealogy       who came from whom
mishaps         what ended episodes in the middle of a life
vision          what the best eyes see
recorder        an animal plays, and is recorded
episode         Episode: one episode, recorded
episode_scene   EpisodeScene: where bodies and eyes were during it
episode_file    episodes stored and loaded
"""
