"""The commands, by the panels of the help: what is asked for, read and claimed, before what computes is imported."""
