"""The question `drumsqueal matrix`: which of many scenes squeal, in which procedure, how loud."""
