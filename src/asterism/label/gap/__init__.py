"""What a gap is estimated from: its ends, the body beside it, the pattern of all; and how well."""
