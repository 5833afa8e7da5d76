"""One folder a question: its command, study, table and figures."""
