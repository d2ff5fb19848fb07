"""What is known of a machine before a run of it is read: its shapes, and what complete runs say of them."""
