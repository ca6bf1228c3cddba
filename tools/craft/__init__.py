"""CAD of the built-in craft, which writes ``assets/targets``. The product reads the files and never imports this."""
