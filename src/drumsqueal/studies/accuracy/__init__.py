"""How wrong is a transient, and what would it cost to be ten times better?"""
