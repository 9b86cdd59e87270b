"""Sinks of a stream, one file each."""
