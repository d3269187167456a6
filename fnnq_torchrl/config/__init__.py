"""The schemas of ``conf/``: types and ranges, without values and without torch."""
