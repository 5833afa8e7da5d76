"""What motions of a model are and how they change with its numbers: between the numerics and the questions."""
