"""Sampled fields carried from plane to plane.

propagate          propagate: one stretch of free space
system             propagate_through: pupils and free space
planes             a plane of a system, sampled for what follows
transfer_function  free space as a filter
sampling           the period of a finite transform
"""
