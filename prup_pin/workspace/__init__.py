"""Where a robot can go: its feasible workspace, the boundary found to a resolution, the volume with its error."""

from .workspace import Workspace, workspace

__all__ = ["Workspace", "workspace"]
