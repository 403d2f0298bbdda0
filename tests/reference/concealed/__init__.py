"""Concealed devices: an independent simulation of a physical 3-PRUP robot, for checks and blind trials."""
