"""``asterism reproduce``: every table and figure of the 2010 report, made anew. One file a part."""
