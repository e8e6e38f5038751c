"""The double-wishbone suspension: wheel travel and rack move its joints."""
