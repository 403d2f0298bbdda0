"""Numbers, words and tables: what is typed and read in a terminal, and what the pictures and pages write.

Quantities with units, joints and diagnoses in words, an answer with its load, tables of it, and one file of text for
each command. The lowest wing: it imports none of the others.
"""
