"""Many scenes: stability and amplitude maps, and the chance of squeal."""
