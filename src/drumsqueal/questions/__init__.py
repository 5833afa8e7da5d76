"""The commands, and a folder or file for each question: its study, table and figures."""
