"""A plug-in of vehiclemor: a quarter car."""
