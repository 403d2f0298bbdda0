"""What is handed on: pages and a notebook's cells with their templates, JSON, a diagnosis's folder.

The top wing: it imports all the others. `report_html` is for users of the package; the rest is imported file by file.
"""

from .pose_report import report_html

__all__ = ["report_html"]
