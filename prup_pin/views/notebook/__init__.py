"""What a notebook shows of an object in a cell: a few lines and tables of HTML, without script or network.

Imports `text` for words.
"""
