"""Results as something to hand on."""
