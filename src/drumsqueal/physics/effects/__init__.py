"""What acts on the body: one effect a file; the contacts of a block and of a disc are in the files of these bodies.

An effect has the two methods of `effect.Effect`, on motions with an entry for each kept coordinate of the body. An
effect that remembers declares a state of its own, which a transient integrates with the motion (`Temperature`).
What a scene does not name is not in the model, and so not in the compiled program.
"""
