"""What people see: text, JSON and pictures. Nothing here computes; import the modules one by one.

Five wings, each knowing those before it and none after: `text` (words, numbers and tables), `scene` (a robot as plain
shapes, for no renderer), then `drawing` (on paper, by matplotlib) and `meshcat` (scenes in a browser), which do not
know each other, and `report` (pages, a notebook's cells, files to hand on).
"""
