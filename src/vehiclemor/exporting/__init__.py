"""Models as text and packages for other tools, printed from the one program."""
