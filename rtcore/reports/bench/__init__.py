"""The benchmark: how fast pictures and rays are, beside the rivals that are installed here."""
