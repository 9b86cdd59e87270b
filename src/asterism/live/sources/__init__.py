"""Sources of a stream, one file each."""
