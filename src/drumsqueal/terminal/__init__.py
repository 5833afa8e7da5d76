"""What the commands share: options, progress, tables, the style of figures."""
