"""Pictures on paper, by matplotlib: the mechanism at a pose, shares, ellipsoids, a diagnosis.

Imports `text` and `scene`; `plotting` alone imports matplotlib.
"""
