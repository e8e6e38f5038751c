"""Exit statuses of the command line."""

# 0 is done; a published bound is missed or a simulation failed; wrong input; interrupted.
MISSED, FAILED, WRONG_INPUT, INTERRUPTED = 1, 1, 2, 130
