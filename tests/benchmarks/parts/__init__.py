"""The parts of the speed benchmark: each measures one thing, judges it against its target and draws it."""
