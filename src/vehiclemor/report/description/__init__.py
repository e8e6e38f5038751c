"""What a registered name is, from its declaration: data that the command line prints."""
