"""What prup_pin does not know of the machines in our workshop: a law, a module, a reader of logs, a robot."""

#: A robot's file, from the folder of this one.
MOUNTED_TABLE = "mounted_table.urdf"
