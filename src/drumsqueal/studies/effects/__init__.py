"""Which effects does a scene need, and what does each cost?"""
