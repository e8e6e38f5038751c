"""Reduction methods: those of one kind in a file; no file knows another."""
