"""The command line: one file for runs, one for studies; the same words as in Python."""

from vehiclemor.cli.app import main as main
