"""Gymnasium's environments as worlds; the library is imported only when such a world is used."""
