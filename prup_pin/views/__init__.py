"""What people see: text, JSON and pictures. Nothing here computes; import the modules one by one.

Six wings, each knowing those before it and none after: `text` (words, numbers and tables), `notebook` (objects in a
notebook's cell), `scene` (a robot as plain shapes, for no renderer), then `drawing` (scenes on paper, by matplotlib)
and `meshcat` (scenes in a browser), which do not know each other, and `report` (pages and files to hand on).
"""
