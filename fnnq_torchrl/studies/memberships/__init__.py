"""The page on where labels come from, ``docs/memberships.md``, made from result files."""
