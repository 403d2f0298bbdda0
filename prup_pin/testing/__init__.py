"""The contracts of what can be added, for the tests of packages that bring their own."""
