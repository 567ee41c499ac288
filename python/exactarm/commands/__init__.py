"""One module per command, found by listing this folder.

A command is a module with the literals `NAME` and `HELP` and the functions

    add_arguments(parser)            its own arguments (commands/arguments.py has the usual ones)
    run(arguments) -> CommandResult  the work; arguments also has seed, threads, kind, out, quiet, progress

The command line reads NAME and HELP without importing the module, so that a command may import what it
needs at the top and `exactarm --help` stays quick. A command writes nothing itself: all results
are in the `CommandResult`, and the frame writes them (commands/output.py).
"""
