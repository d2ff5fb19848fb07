"""Tables out: one module forms the text, one writes files whole, one draws on the terminal, one makes pictures."""
