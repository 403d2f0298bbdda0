"""Scenes in a browser, by meshcat's viewer: commands of its protocol, a page, a small server.

Imports `scene`, and nothing of `drawing`.
"""
