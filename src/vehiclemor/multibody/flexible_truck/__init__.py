"""Truck on a flexible ladder frame: ride over rough roads."""
