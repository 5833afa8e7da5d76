"""The questions that users ask of a whole scene, each a study of many runs."""
