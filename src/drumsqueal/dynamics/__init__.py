"""Many models from many starts: what becomes of each, which motions are the same, and where every start leads."""
