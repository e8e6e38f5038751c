"""Command line: the same functions as the Python interface, one file a command."""

from vehiclemor.cli.app import main as main
