"""Contracts that every registered component keeps, built in or plugged in."""
