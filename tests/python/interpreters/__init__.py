"""Interpreters of robot programs, for tests alone: they execute a program as its controller's documentation
says and know nothing of the package's readers."""
