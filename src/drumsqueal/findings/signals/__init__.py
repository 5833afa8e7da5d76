"""Analysis of a recorded motion: spectra, lines, growth rates and the regime; arrays in, arrays out."""
