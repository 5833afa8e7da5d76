"""One page that shows what a run or a study of the onset has found: words, sound, moving modes, and the template."""
