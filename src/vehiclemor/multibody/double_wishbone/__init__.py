"""The double-wishbone suspension."""
