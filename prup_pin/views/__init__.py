"""What people see: text, JSON and pictures. Nothing here computes; import the modules one by one."""
