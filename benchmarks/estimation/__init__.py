"""How well one curve, its rate and its limit are estimated."""
