"""Tests of vehiclemor."""
