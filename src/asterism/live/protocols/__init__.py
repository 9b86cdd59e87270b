"""Packets of the vendors' protocols: encoding and decoding, pure functions on bytes."""
