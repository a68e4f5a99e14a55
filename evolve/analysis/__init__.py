"""What a run's record and its animals say.

statistics      per generation; acuity, confidence
genealogy       who came from whom
mishaps         what ended episodes in the middle of a life
vision          what the best eyes see
episode         Episode: one episode, recorded
filmed_episode  FilmedEpisode: one in a task of somebody's own
filmed_scene    FilmedScene: where bodies and eyes were during it
"""
