"""What acts on the body, one effect a file.

An effect is a frozen module with

    act(moment, q, v) -> Action      the generalised force and the power it feeds in beyond its potential energy
    potential_energy(moment, q)      in J

where q and v have an entry for each kept coordinate of the body. An effect that remembers declares a state of its own,
which a transient integrates with the motion (`temperature.py`). What a scene does not name is not in the model, and
so not in the compiled program.
"""
