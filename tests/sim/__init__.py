"""Tests of sim: each folder covers the folder of the same name and lists which test covers which module."""
