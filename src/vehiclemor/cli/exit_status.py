"""Exit statuses of the command line."""

# A bound is missed, where that is asked for; a simulation, cells of a study, a plug-in or the
# machine have failed; wrong input; and what the number of a signal is added to.
MISSED, FAILED, WRONG_INPUT, STOPPED = 1, 1, 2, 128
MEANING = """Exit status: 0 done; 1 a simulation has diverged, cells of a study have the status
error, a plug-in breaks, the machine has failed (no space, no memory, a killed worker), or a bound
is missed and --check asks; 2 wrong input; 130 and 143 stopped by Ctrl-C and by SIGTERM."""
