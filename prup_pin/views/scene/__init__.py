"""A robot as plain shapes, lines and colours in base axes, still and moving, known to no renderer.

From a pose and its compliance to bodies, bent beams, symbols, arrows and labels, and the camera that looks at them.
Imports `text` for words; matplotlib and meshcat stay outside.
"""
