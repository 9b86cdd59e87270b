"""Streams: identities for points that arrive frame by frame, and servers of captures."""
